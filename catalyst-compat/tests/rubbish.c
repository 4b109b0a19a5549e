/* Whatever stands in a node: an answer, never a crash. Sound meshes are spoilt in one to three places, again and again.
 *
 *   cc -rdynamic rubbish.c -o rubbish -ldl && ./rubbish libtombolo_catalyst.so pipelines.json [TIMES] */
#include <dlfcn.h>
#include <math.h>

#include "foreign.h"

static uint64_t state = 42;
static uint64_t dice(uint64_t sides)
{
  state ^= state << 13;
  state ^= state >> 7;
  state ^= state << 17;
  return state % sides;
}

static double cube[24];
static const int32_t corners[8] = { 0, 1, 3, 2, 4, 5, 7, 6 };
static const int32_t faces[24] = { 0, 1, 3, 2, 4, 5, 7, 6, 0, 1, 5, 4, 2, 3, 7, 6, 0, 2, 6, 4, 1, 3, 7, 5 };
static const int32_t six[6] = { 0, 1, 2, 3, 4, 5 }, fours[6] = { 4, 4, 4, 4, 4, 4 }, one_six = 6, eight = 8, hex_number = 12, zero = 0;
static const double values[8] = { 1, 2, 3, 4, 5, 6, 7, 8 };
static const int64_t numbers[8] = { 0, 1, 2, 3, 4, 5, 6, 7 };

static void fields(conduit_node* mesh)
{
  text(mesh, "fields/t/association", "vertex");
  text(mesh, "fields/t/topology", "mesh");
  array(mesh, "fields/t/values", FLOAT64, values, 8, 0, 0);
  text(mesh, "fields/n/association", "vertex");
  text(mesh, "fields/n/topology", "mesh");
  array(mesh, "fields/n/values", INT64, numbers, 8, 0, 0);
  text(mesh, "state/metadata/vtk_fields/n/attribute_type", "GlobalIds");
  text(mesh, "fields/g/association", "element");
  text(mesh, "fields/g/topology", "mesh");
  array(mesh, "fields/g/values", INT32, &zero, 1, 0, 0);
  text(mesh, "state/metadata/vtk_fields/g/attribute_type", "Ghosts");
}

static void grid(conduit_node* mesh)
{
  text(mesh, "coordsets/coords/type", "uniform");
  integer(mesh, "coordsets/coords/dims/i", 2);
  integer(mesh, "coordsets/coords/dims/j", 2);
  integer(mesh, "coordsets/coords/dims/k", 2);
  number(mesh, "coordsets/coords/origin/x", 1.0);
  number(mesh, "coordsets/coords/spacing/dx", 0.5);
  text(mesh, "topologies/mesh/type", "uniform");
  text(mesh, "topologies/mesh/coordset", "coords");
}

static void sound(conduit_node* node, int cycle, int kind)
{
  clear(node);
  integer(node, "catalyst/state/timestep", cycle);
  number(node, "catalyst/state/time", 0.1 * cycle);
  conduit_node* channel = at(node, "catalyst/channels/c");
  text(channel, "type", kind == 3 ? "multimesh" : kind == 4 ? "amrmesh" : "mesh");
  integer(channel, "state/features/side", 1);
  conduit_node* mesh = at(channel, "data");
  if (kind >= 3) {
    grid(at(mesh, "a"));
    grid(at(mesh, "b"));
    if (kind == 3) fields(at(mesh, "a"));
    conduit_node* window = at(mesh, "a/nestsets/nest/windows/w");
    text(window, "domain_type", "child");
    integer(window, "origin/i", 0);
    integer(window, "dims/i", 1);
    return;
  }
  text(mesh, "coordsets/coords/type", "explicit");
  array(mesh, "coordsets/coords/values/x", FLOAT64, cube, 8, 0, 24);
  array(mesh, "coordsets/coords/values/y", FLOAT64, cube, 8, 8, 24);
  array(mesh, "coordsets/coords/values/z", FLOAT64, cube, 8, 16, 24);
  text(mesh, "topologies/mesh/type", "unstructured");
  text(mesh, "topologies/mesh/coordset", "coords");
  conduit_node* cells = at(mesh, "topologies/mesh/elements");
  if (kind == 0) {
    text(cells, "shape", "hex");
    array(cells, "connectivity", INT32, corners, 8, 0, 0);
    text(mesh, "topologies/side/type", "unstructured");
    text(mesh, "topologies/side/coordset", "coords");
    text(mesh, "topologies/side/elements/shape", "quad");
    array(mesh, "topologies/side/elements/connectivity", INT32, faces, 4, 0, 0);
    text(mesh, "fields/features/association", "element");
    text(mesh, "fields/features/topology", "side");
    array(mesh, "fields/features/values", INT32, six, 1, 0, 0);
  } else if (kind == 1) {
    text(cells, "shape", "mixed");
    integer(cells, "shape_map/hex", 12);
    array(cells, "shapes", INT32, &hex_number, 1, 0, 0);
    array(cells, "sizes", INT32, &eight, 1, 0, 0);
    array(cells, "offsets", INT32, &zero, 1, 0, 0);
    array(cells, "connectivity", INT32, corners, 8, 0, 0);
  } else {
    text(cells, "shape", "polyhedral");
    array(cells, "connectivity", INT32, six, 6, 0, 0);
    array(cells, "sizes", INT32, &one_six, 1, 0, 0);
    array(mesh, "topologies/mesh/subelements/connectivity", INT32, faces, 24, 0, 0);
    array(mesh, "topologies/mesh/subelements/sizes", INT32, fours, 6, 0, 0);
  }
  fields(mesh);
}

static conduit_node* somewhere(conduit_node* node)
{
  while (node->child_count > 0 && dice(8) != 0) node = node->children[dice((uint64_t)node->child_count)];
  return node;
}

static void spoil(conduit_node* node)
{
  static int32_t integers[16];
  static double reals[16];
  static const char* const words[] = { "", "mesh", "hex", "polyhedral", "mixed", "polygonal", "points", "uniform", "vertex", "element",
    "coords", "structured", "\xff\xfe" };
  const int count = (int)dice(17);
  for (int i = 0; i < count; ++i) {
    integers[i] = (int32_t)dice(20) - 4;
    reals[i] = dice(6) ? (double)dice(9) : dice(2) ? NAN : 1e300;
  }
  const int64_t large[] = { -1, 0, 3, INT64_MAX, INT64_MIN, 1 << 12, (int64_t)UINT32_MAX + 1 };
  conduit_node* place = somewhere(node);
  switch (dice(8)) {
    case 0: clear(place); break;
    case 1: put(place, INT32, integers, count, 0, 4, 1); break;
    case 2: put(place, FLOAT64, reals, count, 0, 8, 1); break;
    case 3: put(place, INT64, &large[dice(7)], 1, 0, 8, 1); break;
    case 4: {
      const char* word = words[dice(13)];
      put(place, TEXT, word, (int64_t)strlen(word) + 1, 0, 1, 1);
      break;
    }
    case 5: put(place, INT32, corners, 8, 0, 0, 0); break;
    /* Too short, or longer than any memory; what is too long by a little cannot be known. */
    case 6: place->type.count = place->type.count > 0 && dice(2) ? (int64_t)dice((uint64_t)place->type.count) : INT64_MAX; break;
    default: clear(add(place, "more", 4, OBJECT)); break;
  }
}

int main(int argc, char** argv)
{
  void* library = argc > 2 ? dlopen(argv[1], RTLD_LAZY | RTLD_GLOBAL) : NULL;
  const struct catalyst_impl* impl = library ? dlsym(library, "catalyst_api_impl") : NULL;
  if (impl == NULL) return 2;
  for (int v = 0; v < 8; ++v) {
    cube[3 * v] = v & 1;
    cube[3 * v + 1] = v >> 1 & 1;
    cube[3 * v + 2] = v >> 2;
  }
  static conduit_node setup, node, results;
  text(&setup, "catalyst/scripts/script", argv[2]);
  if (impl->initialize(&setup) != 0) return 3;
  const int times = argc > 3 ? atoi(argv[3]) : 3000;
  int refused = 0;
  for (int cycle = 0; cycle < times; ++cycle) {
    sound(&node, cycle, (int)dice(5));
    for (uint64_t spoils = 1 + dice(3); spoils > 0; --spoils) spoil(&node);
    const int status = impl->execute(&node);
    if (status != 0 && status != 100) {
      fprintf(stderr, "time %d: status %d\n", cycle, status);
      return 1;
    }
    refused += status != 0;
    if (impl->results(&results) != 0) return 1;
  }
  sound(&node, times, 0);
  if (impl->execute(&node) != 0 || impl->finalize(&setup) != 0) return 1;
  printf("%d of %d refused\n", refused, times);
  clear(&setup);
  clear(&node);
  clear(&results);
  return 0;
}
