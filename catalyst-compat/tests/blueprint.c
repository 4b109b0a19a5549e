/* Nodes that the Blueprint allows and that are easily taken for something else: a boundary whose map of shapes is the volume's or that is
 * in two topologies, a map that names polyhedra of which there are none, a field of materials alone, features and global numbers of
 * vertices in several blocks.
 *
 *   cc -rdynamic blueprint.c -o blueprint -ldl -lm && TOMBOLO_ORDERS=orders.json ./blueprint libtombolo_catalyst.so pipelines.json
 *
 * The order moves the feature `lid` by -0.25 at cycle 1: it is refused where this name does not arrive. */
#include <dlfcn.h>

#include "foreign.h"

static conduit_node setup, node, results;
static const struct catalyst_impl* impl;

static void check(int holds, const char* what, const char* where)
{
  if (holds) return;
  fprintf(stderr, "%s: not as expected: %s\n", where, what);
  exit(1);
}

static double cube[2][24];
static const int32_t corners[8] = { 0, 1, 3, 2, 4, 5, 7, 6 }, sides[8] = { 0, 1, 3, 2, 4, 5, 7, 6 };
static const int32_t eight[1] = { 8 }, fours[2] = { 4, 4 }, tags[2] = { 1, 2 };
static const int32_t of_vertices[8] = { 1, 1, 1, 1, 2, 2, 2, 2 }, numbers[8] = { 0, 1, 2, 3, 4, 5, 6, 7 };
static const uint8_t hexahedron[1] = { 12 }, quads[2] = { 9, 9 };
static const double part[1] = { 0.5 };

static void coordinates(conduit_node* mesh, int which)
{
  text(mesh, "coordsets/coords/type", "explicit");
  array(mesh, "coordsets/coords/values/x", FLOAT64, cube[which], 8, 0, 24);
  array(mesh, "coordsets/coords/values/y", FLOAT64, cube[which], 8, 8, 24);
  array(mesh, "coordsets/coords/values/z", FLOAT64, cube[which], 8, 16, 24);
}

static conduit_node* topology(conduit_node* mesh, const char* name)
{
  conduit_node* made = at(at(mesh, "topologies"), name);
  text(made, "type", "unstructured");
  text(made, "coordset", "coords");
  return at(made, "elements");
}

/* Mixed cells by a map of all shapes. */
static void mixed(conduit_node* cells, const uint8_t* shapes, const int32_t* sizes, int64_t count, const int32_t* connectivity)
{
  text(cells, "shape", "mixed");
  integer(cells, "shape_map/quad", 9);
  integer(cells, "shape_map/hex", 12);
  integer(cells, "shape_map/polyhedral", 42);
  array(cells, "shapes", UINT8, shapes, count, 0, 0);
  array(cells, "sizes", INT32, sizes, count, 0, 0);
  array(cells, "connectivity", INT32, connectivity, 8, 0, 0);
}

static void volume(conduit_node* mesh) { mixed(topology(mesh, "volume"), hexahedron, eight, 1, corners); }

static void boundary(conduit_node* mesh)
{
  mixed(topology(mesh, "boundary"), quads, fours, 2, sides);
  text(mesh, "fields/boundary_attribute/association", "element");
  text(mesh, "fields/boundary_attribute/topology", "boundary");
  array(mesh, "fields/boundary_attribute/values", INT32, tags, 2, 0, 0);
}

/* A field of ones on a topology, in each of its cells. */
static void field_of(conduit_node* mesh, const char* name, const char* of)
{
  char path[64];
  snprintf(path, sizeof path, "fields/%s/association", name);
  text(mesh, path, "element");
  snprintf(path, sizeof path, "fields/%s/topology", name);
  text(mesh, path, of);
  snprintf(path, sizeof path, "fields/%s/values", name);
  array(mesh, path, INT32, tags, 1, 0, 0);
}

/* A second volume and a line, each with a field: the cells are those of the first volume. */
static void more_topologies(conduit_node* mesh)
{
  mixed(topology(mesh, "solid"), hexahedron, eight, 1, corners);
  field_of(mesh, "stress", "solid");
  conduit_node* cells = topology(mesh, "wire");
  text(cells, "shape", "line");
  array(cells, "connectivity", INT32, corners, 2, 0, 0);
  field_of(mesh, "wire_attribute", "wire");
}

static void features_of_vertices(conduit_node* mesh)
{
  text(mesh, "fields/features/association", "vertex");
  array(mesh, "fields/features/values", INT32, of_vertices, 8, 0, 0);
}

/* The boundary in two topologies, each with a field of its own that says which features its faces belong to. */
static void two_boundaries(conduit_node* mesh)
{
  static const char* names[2] = { "lower", "upper" };
  for (int which = 0; which < 2; ++which) {
    conduit_node* cells = topology(mesh, names[which]);
    text(cells, "shape", "quad");
    array(cells, "connectivity", INT32, sides + 4 * which, 4, 0, 0);
    char path[64];
    snprintf(path, sizeof path, "fields/%s_attribute/association", names[which]);
    text(mesh, path, "element");
    snprintf(path, sizeof path, "fields/%s_attribute/topology", names[which]);
    text(mesh, path, names[which]);
    snprintf(path, sizeof path, "fields/%s_attribute/values", names[which]);
    array(mesh, path, INT32, tags + which, 1, 0, 0);
  }
}

/* A field of a material's values, beside one that has its own. */
static void materials(conduit_node* mesh)
{
  text(mesh, "fields/fraction/association", "element");
  text(mesh, "fields/fraction/topology", "volume");
  text(mesh, "fields/fraction/matset", "matset");
  array(mesh, "fields/fraction/matset_values/air", FLOAT64, part, 1, 0, 0);
}

/* Two steps of the channel, over the second of which its lid goes down. */
static void steps(const char* script, const char* where)
{
  text(&node, "catalyst/channels/box/type", walk(&node, "catalyst/channels/box/data/coordsets", 0) ? "mesh" : "multimesh");
  integer(&node, "catalyst/channels/box/state/features/floor", 1);
  integer(&node, "catalyst/channels/box/state/features/lid", 2);
  text(&setup, "catalyst/scripts/script", script);
  check(impl->initialize(&setup) == 0, "initialize", where);
  for (int cycle = 0; cycle < 2; ++cycle) {
    integer(&node, "catalyst/state/timestep", cycle);
    number(&node, "catalyst/state/time", 0.5 * cycle);
    check(impl->execute(&node) == 0 && impl->results(&results) == 0, "a step", where);
    check(catalyst_conduit_node_has_path(&results, "catalyst/box") == (cycle == 1), "the lid moves", where);
  }
  check(impl->finalize(&setup) == 0, "finalize", where);
  clear(&setup);
  clear(&node);
  clear(&results);
}

int main(int argc, char** argv)
{
  void* library = argc > 2 ? dlopen(argv[1], RTLD_LAZY | RTLD_GLOBAL) : NULL;
  impl = library ? dlsym(library, "catalyst_api_impl") : NULL;
  if (impl == NULL) return 2;
  for (int which = 0; which < 2; ++which)
    for (int v = 0; v < 8; ++v) {
      cube[which][3 * v] = (v & 1) + 5 * which;
      cube[which][3 * v + 1] = v >> 1 & 1;
      cube[which][3 * v + 2] = v >> 2;
    }
  conduit_node* mesh = at(&node, "catalyst/channels/box/data");
  coordinates(mesh, 0);
  boundary(mesh);
  volume(mesh);
  steps(argv[2], "the boundary named first");

  mesh = at(&node, "catalyst/channels/box/data");
  coordinates(mesh, 0);
  volume(mesh);
  boundary(mesh);
  materials(mesh);
  steps(argv[2], "the boundary named second, and materials");

  mesh = at(&node, "catalyst/channels/box/data");
  coordinates(mesh, 0);
  volume(mesh);
  features_of_vertices(mesh);
  steps(argv[2], "features of vertices");

  mesh = at(&node, "catalyst/channels/box/data");
  coordinates(mesh, 0);
  volume(mesh);
  two_boundaries(mesh);
  more_topologies(mesh);
  steps(argv[2], "the boundary in two topologies, and others");

  for (int which = 0; which < 2; ++which) {
    mesh = at(&node, which ? "catalyst/channels/box/data/right" : "catalyst/channels/box/data/left");
    coordinates(mesh, which);
    volume(mesh);
    features_of_vertices(mesh);
    text(mesh, "fields/number/association", "vertex");
    array(mesh, "fields/number/values", INT32, numbers, 8, 0, 0);
    text(mesh, "state/metadata/vtk_fields/number/attribute_type", "GlobalIds");
  }
  steps(argv[2], "features of vertices in two blocks");
  return 0;
}
