/* Every mesh of the Blueprint in a channel of its own, each written to a file by a pipeline of the type "io".
 *
 *   cc -rdynamic meshes.c -o meshes -ldl && TOMBOLO_OUTPUT=somewhere ./meshes libtombolo_catalyst.so */
#include <dlfcn.h>

#include "foreign.h"

static conduit_node setup, node;

static conduit_node* channel(const char* name, const char* type)
{
  char path[128];
  snprintf(path, sizeof path, "catalyst/pipelines/%s/type", name);
  text(&setup, path, "io");
  snprintf(path, sizeof path, "catalyst/pipelines/%s/filename", name);
  char file[64];
  snprintf(file, sizeof file, "%s-{timestep}.vtu", name);
  text(&setup, path, file);
  snprintf(path, sizeof path, "catalyst/pipelines/%s/channel", name);
  text(&setup, path, name);
  snprintf(path, sizeof path, "catalyst/channels/%s", name);
  conduit_node* made = at(&node, path);
  text(made, "type", type);
  return at(made, "data");
}

static void explicit_points(conduit_node* mesh, const double* points, int64_t count)
{
  text(mesh, "coordsets/coords/type", "explicit");
  array(mesh, "coordsets/coords/values/x", FLOAT64, points, count, 0, 24);
  array(mesh, "coordsets/coords/values/y", FLOAT64, points, count, 8, 24);
  array(mesh, "coordsets/coords/values/z", FLOAT64, points, count, 16, 24);
}

static conduit_node* topology(conduit_node* mesh, const char* type)
{
  text(mesh, "topologies/mesh/type", type);
  text(mesh, "topologies/mesh/coordset", "coords");
  return at(mesh, "topologies/mesh");
}

static conduit_node* shape(conduit_node* mesh, const char* name)
{
  conduit_node* made = topology(mesh, "unstructured");
  text(made, "elements/shape", name);
  return made;
}

static void field(conduit_node* mesh, const char* name, const char* association, int64_t id, const void* values, int64_t count)
{
  char path[96];
  snprintf(path, sizeof path, "fields/%s/association", name);
  text(mesh, path, association);
  snprintf(path, sizeof path, "fields/%s/topology", name);
  text(mesh, path, "mesh");
  snprintf(path, sizeof path, "fields/%s/values", name);
  array(mesh, path, id, values, count, 0, 0);
}

static void uniform(conduit_node* mesh, int ni, int nj, int nk, double x, double d)
{
  text(mesh, "coordsets/coords/type", "uniform");
  integer(mesh, "coordsets/coords/dims/i", ni);
  integer(mesh, "coordsets/coords/dims/j", nj);
  if (nk) integer(mesh, "coordsets/coords/dims/k", nk);
  number(mesh, "coordsets/coords/origin/x", x);
  number(mesh, "coordsets/coords/spacing/dx", d);
  number(mesh, "coordsets/coords/spacing/dy", d);
  if (nk) number(mesh, "coordsets/coords/spacing/dz", d);
  topology(mesh, "uniform");
}

/* Two unit cubes side by side along x: vertex i + 3 j + 6 k at (i, j, k). */
static double two_cubes[36];
static const int64_t hexes[] = { 0, 1, 4, 3, 6, 7, 10, 9, 1, 2, 5, 4, 7, 8, 11, 10 };

int main(int argc, char** argv)
{
  void* library = argc > 1 ? dlopen(argv[1], RTLD_LAZY | RTLD_GLOBAL) : NULL;
  const struct catalyst_impl* impl = library ? dlsym(library, "catalyst_api_impl") : NULL;
  if (impl == NULL) {
    fprintf(stderr, "no implementation\n");
    return 1;
  }
  for (int v = 0; v < 12; ++v) {
    two_cubes[3 * v] = v % 3;
    two_cubes[3 * v + 1] = v / 3 % 2;
    two_cubes[3 * v + 2] = v / 6;
  }
  double along[12];
  for (int v = 0; v < 12; ++v) along[v] = 10 * two_cubes[3 * v];

  conduit_node* mesh = channel("uniform", "mesh");
  uniform(mesh, 3, 2, 2, 0.0, 1.0);
  const float of_cells[2] = { 1.5f, 2.5f };
  field(mesh, "single", "element", FLOAT32, of_cells, 2);
  const int8_t small[2] = { -1, 7 };
  field(mesh, "small", "element", INT8, small, 2);
  field(mesh, "along", "vertex", FLOAT64, along, 12);

  mesh = channel("rectilinear", "mesh");
  const float xs[4] = { 0, 1, 3, 6 };
  const double ys[3] = { 0, 0.5, 2 };
  text(mesh, "coordsets/coords/type", "rectilinear");
  array(mesh, "coordsets/coords/values/x", FLOAT32, xs, 4, 0, 0);
  array(mesh, "coordsets/coords/values/y", FLOAT64, ys, 3, 0, 0);
  topology(mesh, "rectilinear");

  mesh = channel("structured", "mesh");
  explicit_points(mesh, two_cubes, 12);
  conduit_node* grid = topology(mesh, "structured");
  integer(grid, "elements/dims/i", 2);
  integer(grid, "elements/dims/j", 1);
  integer(grid, "elements/dims/k", 1);
  field(mesh, "along", "vertex", FLOAT64, along, 12);

  /* Coordinates in single precision, four to a point, as a solver with homogeneous ones has them; 64-bit connectivity. */
  mesh = channel("hex", "mesh");
  float padded[48];
  for (int v = 0; v < 12; ++v)
    for (int axis = 0; axis < 4; ++axis) padded[4 * v + axis] = axis < 3 ? (float)two_cubes[3 * v + axis] : 1.0f;
  text(mesh, "coordsets/coords/type", "explicit");
  array(mesh, "coordsets/coords/values/x", FLOAT32, padded, 12, 0, 16);
  array(mesh, "coordsets/coords/values/y", FLOAT32, padded, 12, 4, 16);
  array(mesh, "coordsets/coords/values/z", FLOAT32, padded, 12, 8, 16);
  array(shape(mesh, "hex"), "elements/connectivity", INT64, hexes, 16, 0, 0);
  text(mesh, "fields/place/association", "vertex");
  text(mesh, "fields/place/topology", "mesh");
  array(mesh, "fields/place/values/u", FLOAT64, two_cubes, 12, 0, 24);
  array(mesh, "fields/place/values/v", FLOAT64, two_cubes, 12, 8, 24);
  array(mesh, "fields/place/values/w", FLOAT64, two_cubes, 12, 16, 24);
  /* Big endian, as read from a file. */
  const uint8_t big[4] = { 0x01, 0x02, 0x00, 0x05 };
  field(mesh, "big", "element", UINT16, big, 2);
  at(mesh, "fields/big/values")->type.endianness = 1;

  mesh = channel("tet", "mesh");
  explicit_points(mesh, two_cubes, 12);
  const uint32_t tets[8] = { 0, 1, 3, 6, 2, 5, 1, 8 };
  array(shape(mesh, "tet"), "elements/connectivity", UINT32, tets, 8, 0, 0);

  mesh = channel("wedge", "mesh");
  explicit_points(mesh, two_cubes, 12);
  const int32_t wedge[6] = { 0, 3, 1, 6, 9, 7 };
  array(shape(mesh, "wedge"), "elements/connectivity", INT32, wedge, 6, 0, 0);

  mesh = channel("pyramid", "mesh");
  explicit_points(mesh, two_cubes, 12);
  const int32_t pyramid[5] = { 0, 1, 4, 3, 6 };
  array(shape(mesh, "pyramid"), "elements/connectivity", INT32, pyramid, 5, 0, 0);

  mesh = channel("tri", "mesh");
  explicit_points(mesh, two_cubes, 12);
  const int32_t tri[6] = { 0, 1, 4, 0, 4, 3 };
  array(shape(mesh, "tri"), "elements/connectivity", INT32, tri, 6, 0, 0);

  mesh = channel("quad", "mesh");
  explicit_points(mesh, two_cubes, 12);
  const int32_t quad[8] = { 0, 1, 4, 3, 1, 2, 5, 4 };
  array(shape(mesh, "quad"), "elements/connectivity", INT32, quad, 8, 0, 0);

  mesh = channel("line", "mesh");
  explicit_points(mesh, two_cubes, 12);
  const int32_t line[4] = { 0, 1, 1, 2 };
  array(shape(mesh, "line"), "elements/connectivity", INT32, line, 4, 0, 0);

  mesh = channel("point", "mesh");
  explicit_points(mesh, two_cubes, 12);
  const int32_t point[3] = { 0, 5, 7 };
  array(shape(mesh, "point"), "elements/connectivity", INT32, point, 3, 0, 0);

  mesh = channel("points", "mesh");
  explicit_points(mesh, two_cubes, 12);
  topology(mesh, "points");

  /* A hexahedron; the other cube as two wedges, one of them as a pyramid and a tetrahedron. */
  mesh = channel("mixed", "mesh");
  explicit_points(mesh, two_cubes, 12);
  const int32_t mixed[] = { 0, 1, 4, 3, 6, 7, 10, 9, 1, 4, 2, 7, 10, 8, 4, 5, 11, 10, 8, 5, 4, 2, 8 };
  const int32_t sizes[] = { 8, 6, 5, 4 }, offsets[] = { 0, 8, 14, 19 };
  const uint8_t shapes[] = { 12, 13, 14, 10 };
  conduit_node* cells = shape(mesh, "mixed");
  integer(cells, "elements/shape_map/hex", 12);
  integer(cells, "elements/shape_map/wedge", 13);
  integer(cells, "elements/shape_map/pyramid", 14);
  integer(cells, "elements/shape_map/tet", 10);
  array(cells, "elements/connectivity", INT32, mixed, 23, 0, 0);
  array(cells, "elements/sizes", INT32, sizes, 4, 0, 0);
  array(cells, "elements/offsets", INT32, offsets, 4, 0, 0);
  array(cells, "elements/shapes", UINT8, shapes, 4, 0, 0);
  const double each[4] = { 1, 2, 3, 4 };
  field(mesh, "each", "element", FLOAT64, each, 4);

  mesh = channel("polygonal", "mesh");
  explicit_points(mesh, two_cubes, 12);
  const int32_t polygons[] = { 0, 1, 2, 5, 4, 3, 6, 7, 10 }, polygon_sizes[] = { 6, 3 };
  cells = shape(mesh, "polygonal");
  array(cells, "elements/connectivity", INT32, polygons, 9, 0, 0);
  array(cells, "elements/sizes", INT32, polygon_sizes, 2, 0, 0);

  /* Both cubes by their faces; the one between them is stored once. */
  mesh = channel("polyhedral", "mesh");
  explicit_points(mesh, two_cubes, 12);
  const int64_t faces[] = { 0, 3, 9, 6, 1, 4, 10, 7, 0, 1, 7, 6, 3, 4, 10, 9, 0, 1, 4, 3, 6, 7, 10, 9, 2, 5, 11, 8, 1, 2, 8, 7,
    4, 5, 11, 10, 1, 2, 5, 4, 7, 8, 11, 10 };
  const int64_t face_sizes[11] = { 4, 4, 4, 4, 4, 4, 4, 4, 4, 4, 4 };
  const int64_t of_polyhedra[12] = { 0, 1, 2, 3, 4, 5, 1, 6, 7, 8, 9, 10 }, polyhedron_sizes[2] = { 6, 6 };
  cells = shape(mesh, "polyhedral");
  array(cells, "elements/connectivity", INT64, of_polyhedra, 12, 0, 0);
  array(cells, "elements/sizes", INT64, polyhedron_sizes, 2, 0, 0);
  text(cells, "subelements/shape", "polygonal");
  array(cells, "subelements/connectivity", INT64, faces, 44, 0, 0);
  array(cells, "subelements/sizes", INT64, face_sizes, 11, 0, 0);

  conduit_node* blocks = channel("blocks", "multimesh");
  const float one = 1.0f, two = 2.0f;
  uniform(at(blocks, "left"), 2, 2, 2, 0.0, 1.0);
  field(at(blocks, "left"), "which", "element", FLOAT32, &one, 1);
  field(at(blocks, "left"), "alone", "element", FLOAT32, &one, 1);
  uniform(at(blocks, "right"), 2, 2, 2, 5.0, 2.0);
  field(at(blocks, "right"), "which", "element", FLOAT32, &two, 1);

  /* Four by four cells, the four in the middle covered by sixteen finer ones. */
  blocks = channel("amr", "amrmesh");
  conduit_node* coarse = at(blocks, "domain_0");
  uniform(coarse, 5, 5, 0, 0.0, 1.0);
  integer(coarse, "state/domain_id", 0);
  integer(coarse, "state/level", 0);
  text(coarse, "nestsets/nest/association", "element");
  text(coarse, "nestsets/nest/topology", "mesh");
  conduit_node* window = at(coarse, "nestsets/nest/windows/window_1");
  integer(window, "domain_id", 1);
  text(window, "domain_type", "child");
  integer(window, "origin/i", 1);
  integer(window, "origin/j", 1);
  integer(window, "dims/i", 2);
  integer(window, "dims/j", 2);
  integer(window, "ratio/i", 2);
  integer(window, "ratio/j", 2);
  double level[16] = { 0 };
  field(coarse, "level", "element", FLOAT64, level, 16);
  conduit_node* fine = at(blocks, "domain_1");
  uniform(fine, 5, 5, 0, 1.0, 0.5);
  number(fine, "coordsets/coords/origin/y", 1.0);
  double finer[16];
  for (int i = 0; i < 16; ++i) finer[i] = 1.0;
  field(fine, "level", "element", FLOAT64, finer, 16);

  /* The same by the levels that the grids give, with a window that names its own grid; and a third level in two more cells. */
  blocks = channel("levels", "amrmesh");
  coarse = at(blocks, "domain_0");
  uniform(coarse, 5, 5, 0, 0.0, 1.0);
  integer(coarse, "state/domain_id", 0);
  integer(coarse, "state/level", 0);
  window = at(coarse, "nestsets/nest/windows/window_0");
  integer(window, "domain_id", 0);
  text(window, "domain_type", "child");
  integer(window, "origin/i", 0);
  integer(window, "origin/j", 0);
  integer(window, "dims/i", 4);
  integer(window, "dims/j", 4);
  fine = at(blocks, "domain_1");
  uniform(fine, 5, 5, 0, 1.0, 0.5);
  number(fine, "coordsets/coords/origin/y", 1.0);
  integer(fine, "state/domain_id", 1);
  integer(fine, "state/level", 1);
  fine = at(blocks, "domain_2");
  uniform(fine, 5, 3, 0, 2.0, 0.25);
  number(fine, "coordsets/coords/origin/y", 2.5);
  integer(fine, "state/domain_id", 2);
  integer(fine, "state/level", 2);

  text(&setup, "catalyst/pipelines/script/filename", argv[2]);
  if (impl->initialize(&setup) != 0) return 1;
  for (int cycle = 0; cycle < 3; ++cycle) {
    integer(&node, "catalyst/state/cycle", cycle);
    number(&node, "catalyst/state/time", 0.5 * cycle);
    if (impl->execute(&node) != 0) return 1;
    /* The solver moves its points and changes its values where they lie. */
    for (int v = 0; v < 12; ++v) {
      two_cubes[3 * v + 2] *= 2;
      along[v] += 1;
    }
  }
  if (impl->finalize(&setup) != 0) return 1;
  clear(&setup);
  clear(&node);
  return 0;
}
