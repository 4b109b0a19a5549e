/* What catalyst_results hands back while an order is carried out: a mesh in one piece, one of two blocks, and one that is not the first
 * channel; in both layouts; and nothing once the mesh rests, though the node is the same.
 *
 *   cc -rdynamic motion.c -o motion -ldl -lm && TOMBOLO_ORDERS=orders.json ./motion libtombolo_catalyst.so pipelines.json
 *
 * The orders move what lies at z = 1 by -0.2 in two shapes, from cycle 2 on, and stop the run at cycle 6. */
#include <dlfcn.h>
#include <math.h>

#include "foreign.h"

static void check(int holds, const char* what, int cycle)
{
  if (holds) return;
  fprintf(stderr, "cycle %d: not as expected: %s\n", cycle, what);
  exit(1);
}

static double value(conduit_node* results, const char* path, int64_t index)
{
  conduit_node* found = walk(results, path, 0);
  if (!found || found->type.id != FLOAT64 || index >= found->type.count) {
    fprintf(stderr, "no %s\n", path);
    exit(1);
  }
  double number;
  memcpy(&number, found->data + found->type.offset + index * found->type.stride, sizeof number);
  return number;
}

/* A cube of eight hexahedra with its lower corner at x. */
static void cube(conduit_node* mesh, double x)
{
  text(mesh, "coordsets/coords/type", "uniform");
  const char* axes[] = { "coordsets/coords/dims/i", "coordsets/coords/dims/j", "coordsets/coords/dims/k" };
  const char* spacings[] = { "coordsets/coords/spacing/dx", "coordsets/coords/spacing/dy", "coordsets/coords/spacing/dz" };
  for (int axis = 0; axis < 3; ++axis) {
    integer(mesh, axes[axis], 3);
    number(mesh, spacings[axis], 0.5);
  }
  number(mesh, "coordsets/coords/origin/x", x);
  text(mesh, "topologies/mesh/type", "uniform");
  text(mesh, "topologies/mesh/coordset", "coords");
}

/* One mesh of points at `root`, asked to be at this shape: 0 at rest, 1 half way, 2 done. A grid cannot follow: it is lent at rest
   each time, and each displacement starts there. */
static void at_shape(conduit_node* results, const char* root, double x, int shape, int cycle)
{
  char path[128];
  for (int v = 0; v < 27; ++v) {
    const double place[3] = { x + 0.5 * (v % 3), 0.5 * (v / 3 % 3), 0.5 * (v / 9) };
    for (int axis = 0; axis < 3; ++axis) {
      const char name = (char)('x' + axis);
      snprintf(path, sizeof path, "%s/coordsets/coords/values/%c", root, name);
      const double to = value(results, path, v);
      snprintf(path, sizeof path, "%s/fields/displacement/values/%c", root, name);
      const double way = value(results, path, v);
      snprintf(path, sizeof path, "%s/fields/velocity/values/%c", root, name);
      check(fabs(value(results, path, v) - way / 0.1) < 1e-12, "velocity", cycle);
      if (v / 9 == 0) check(fabs(to - place[axis]) < 1e-12, "what is held", cycle);
      if (v / 9 == 2) {
        const double down = axis == 2 ? 0.1 : 0.0;
        check(fabs(to - (place[axis] - shape * down)) < 1e-12 && fabs(way + shape * down) < 1e-12, "what is moved", cycle);
      }
    }
  }
  snprintf(path, sizeof path, "%s/topologies/mesh/coordset", root);
  check(walk(results, path, 0) != NULL, "a topology", cycle);

  /* The boundary: all vertices but the one in the middle, by their numbers in this mesh. */
  snprintf(path, sizeof path, "%s/fields/surface_vertices/values", root);
  conduit_node* numbers = walk(results, path, 0);
  check(numbers != NULL && numbers->type.count == 26, "the boundary's vertices", cycle);
  for (int place = 0; place < 26; ++place) {
    int64_t v;
    memcpy(&v, numbers->data + numbers->type.offset + place * numbers->type.stride, sizeof v);
    check(v >= 0 && v < 27 && v != 13, "a vertex of the boundary", cycle);
    const char* of_mesh[] = { "coordsets/coords/values", "fields/displacement/values", "fields/velocity/values" };
    const char* of_surface[] = { "coordsets/surface/values", "fields/surface_displacement/values", "fields/surface_velocity/values" };
    for (int pair = 0; pair < 3; ++pair) {
      for (char name = 'x'; name <= 'z'; ++name) {
        snprintf(path, sizeof path, "%s/%s/%c", root, of_mesh[pair], name);
        const double whole = value(results, path, v);
        snprintf(path, sizeof path, "%s/%s/%c", root, of_surface[pair], name);
        check(value(results, path, place) == whole, "the surface is the mesh's", cycle);
      }
    }
  }
}

int main(int argc, char** argv)
{
  void* library = argc > 2 ? dlopen(argv[1], RTLD_LAZY | RTLD_GLOBAL) : NULL;
  const struct catalyst_impl* impl = library ? dlsym(library, "catalyst_api_impl") : NULL;
  if (impl == NULL) return 2;
  for (int pass = 0; pass < 3; ++pass) {
    const int blocks = pass == 1;
    static conduit_node setup, node, results;
    text(&setup, "catalyst/scripts/script", argv[2]);
    number(&setup, "catalyst/parameters/heating/value", 1.5);
    if (impl->initialize(&setup) != 0) return 1;
    if (pass == 2) {
      text(&node, "catalyst/channels/aside/type", "mesh");
      cube(at(&node, "catalyst/channels/aside/data"), 20.0);
    }
    text(&node, "catalyst/channels/box/type", blocks ? "multimesh" : "mesh");
    if (blocks) {
      cube(at(&node, "catalyst/channels/box/data/left"), 0.0);
      cube(at(&node, "catalyst/channels/box/data/right"), 5.0);
    } else {
      cube(at(&node, "catalyst/channels/box/data"), 0.0);
    }
    int shape = 0;
    for (int cycle = 0; cycle < 8; ++cycle) {
      integer(&node, "catalyst/state/timestep", cycle);
      number(&node, "catalyst/state/time", 0.1 * cycle);
      if (cycle == 0) number(&node, "catalyst/state/time_step", 0.1);
      if (impl->execute(&node) != 0 || impl->results(&results) != 0) return 1;
      const int moves = cycle == 2 || cycle == 4;
      check(catalyst_conduit_node_has_path(&results, "catalyst/box") == moves, "the mesh moves at cycles 2 and 4 alone", cycle);
      check(!catalyst_conduit_node_has_path(&results, "catalyst/aside"), "another channel stays", cycle);
      check(value(&results, "catalyst/steering/fields/moving/values", 0) == moves, "moving", cycle);
      check(value(&results, "catalyst/steering/data/fields/heating/values", 0) == (cycle < 3 ? 1.5 : 2.5), "a parameter", cycle);
      check(value(&results, "catalyst/steering/fields/stop/values", 0) == (cycle >= 6), "stop", cycle);
      if (!moves) continue;
      ++shape;
      check(value(&results, "catalyst/steering/fields/shape/values", 0) == shape, "the shape's number", cycle);
      check(value(&results, "catalyst/steering/fields/shapes/values", 0) == 2, "how many there are", cycle);
      check(strcmp(walk(&results, "catalyst/box/state/order", 0)->data, "press") == 0, "the order's name", cycle);
      if (blocks) {
        at_shape(&results, "catalyst/box/left", 0.0, shape, cycle);
        at_shape(&results, "catalyst/box/right", 5.0, shape, cycle);
        at_shape(&results, "catalyst/box/data/right", 5.0, shape, cycle);
      } else {
        at_shape(&results, "catalyst/box", 0.0, shape, cycle);
        at_shape(&results, "catalyst/box/data", 0.0, shape, cycle);
      }
    }
    if (impl->finalize(&setup) != 0) return 1;
    clear(&setup);
    clear(&node);
    clear(&results);
  }
  return 0;
}
