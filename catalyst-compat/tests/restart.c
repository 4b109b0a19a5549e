/* A run that is ended in the middle of an order and goes on from the checkpoint that catalyst/state/checkpoint asked for: at every step
 * from there on its mesh is to the bit that of the run that was not interrupted.
 *
 *   cc -rdynamic restart.c -o restart -ldl -lm && TOMBOLO_ORDERS=orders.json ./restart libtombolo_catalyst.so pipelines.json
 *
 * The orders move what lies at z = 1 from cycle 2 on, in three shapes of two steps each, and undo that at cycle 10. The checkpoint is the
 * file pipelines.json.state. */
#include <dlfcn.h>

#include "foreign.h"

enum { SIDE = 4, POINTS = SIDE * SIDE * SIDE, CUBES = (SIDE - 1) * (SIDE - 1) * (SIDE - 1), STEPS = 16, LAST = 4 };
static double points[3 * POINTS], rest[3 * POINTS], whole[STEPS][3 * POINTS];
static int32_t cubes[8 * CUBES];
static char state[512];

static void check(int holds, const char* what, int cycle)
{
  if (holds) return;
  fprintf(stderr, "cycle %d: not as expected: %s\n", cycle, what);
  exit(1);
}

static double value(conduit_node* results, const char* path, int64_t index)
{
  conduit_node* found = walk(results, path, 0);
  check(found && found->type.id == FLOAT64 && index < found->type.count, path, -1);
  double number;
  memcpy(&number, found->data + found->type.offset + index * found->type.stride, sizeof number);
  return number;
}

/* From one cycle up to another; at the last a checkpoint where one is wanted. The box moves as it is asked to. */
static void run(const struct catalyst_impl* impl, const char* script, int restarts, int first, int last, int saves)
{
  static conduit_node setup, node, results;
  text(&setup, "catalyst/scripts/script", script);
  if (restarts) text(&setup, "catalyst/restart", state);
  check(impl->initialize(&setup) == 0, "initialize", first);
  text(&node, "catalyst/channels/box/type", "mesh");
  conduit_node* mesh = at(&node, "catalyst/channels/box/data");
  text(mesh, "coordsets/coords/type", "explicit");
  array(mesh, "coordsets/coords/values/x", FLOAT64, points, POINTS, 0, 24);
  array(mesh, "coordsets/coords/values/y", FLOAT64, points, POINTS, 8, 24);
  array(mesh, "coordsets/coords/values/z", FLOAT64, points, POINTS, 16, 24);
  text(mesh, "topologies/mesh/type", "unstructured");
  text(mesh, "topologies/mesh/coordset", "coords");
  text(mesh, "topologies/mesh/elements/shape", "hex");
  array(mesh, "topologies/mesh/elements/connectivity", INT32, cubes, 8 * CUBES, 0, 0);
  for (int cycle = first; cycle <= last; ++cycle) {
    integer(&node, "catalyst/state/timestep", cycle);
    number(&node, "catalyst/state/time", 0.25 * cycle);
    number(&node, "catalyst/state/time_step", 0.25);
    if (saves && cycle == last) text(&node, "catalyst/state/checkpoint", state);
    check(impl->execute(&node) == 0 && impl->results(&results) == 0, "execute", cycle);
    if (saves && cycle == last) {
      const double shape = value(&results, "catalyst/steering/fields/shape/values", 0);
      check(shape > 0 && shape < value(&results, "catalyst/steering/fields/shapes/values", 0), "an order under way", cycle);
    }
    if (catalyst_conduit_node_has_path(&results, "catalyst/box"))
      for (int v = 0; v < POINTS; ++v) {
        points[3 * v] = value(&results, "catalyst/box/coordsets/coords/values/x", v);
        points[3 * v + 1] = value(&results, "catalyst/box/coordsets/coords/values/y", v);
        points[3 * v + 2] = value(&results, "catalyst/box/coordsets/coords/values/z", v);
      }
    if (restarts || saves) check(memcmp(points, whole[cycle], sizeof points) == 0, "the mesh", cycle);
    else memcpy(whole[cycle], points, sizeof points);
  }
  check(impl->finalize(&setup) == 0, "finalize", last);
  clear(&setup);
  clear(&node);
  clear(&results);
}

int main(int argc, char** argv)
{
  void* library = argc > 2 ? dlopen(argv[1], RTLD_LAZY | RTLD_GLOBAL) : NULL;
  const struct catalyst_impl* impl = library ? dlsym(library, "catalyst_api_impl") : NULL;
  if (impl == NULL) return 2;
  snprintf(state, sizeof state, "%s.state", argv[2]);
  static const int corners[8] = { 0, 1, SIDE + 1, SIDE, SIDE * SIDE, SIDE * SIDE + 1, SIDE * SIDE + SIDE + 1, SIDE * SIDE + SIDE };
  for (int v = 0; v < POINTS; ++v) {
    const int place[3] = { v % SIDE, v / SIDE % SIDE, v / SIDE / SIDE };
    for (int axis = 0; axis < 3; ++axis) rest[3 * v + axis] = place[axis] / (SIDE - 1.0);
  }
  for (int c = 0; c < CUBES; ++c)
    for (int k = 0; k < 8; ++k)
      cubes[8 * c + k] = c % (SIDE - 1) + c / (SIDE - 1) % (SIDE - 1) * SIDE + c / (SIDE - 1) / (SIDE - 1) * SIDE * SIDE + corners[k];

  memcpy(points, rest, sizeof points);
  run(impl, argv[2], 0, 0, STEPS - 1, 0);
  check(memcmp(whole[1], rest, sizeof rest) == 0 && memcmp(whole[9], rest, sizeof rest) != 0, "the box moves", 9);
  check(memcmp(whole[STEPS - 1], rest, sizeof rest) == 0, "the box is back at rest", STEPS - 1);
  memcpy(points, rest, sizeof points);
  run(impl, argv[2], 0, 0, LAST, 1);
  run(impl, argv[2], 1, LAST + 1, STEPS - 1, 0);
  return 0;
}
