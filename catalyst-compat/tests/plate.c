/* Meshes of two coordinates, in every kind of coordset: an order that would move their vertices along z is rejected, because the solver
 * could not take that coordinate; one that stays in the plane is carried out.
 *
 *   cc -rdynamic plate.c -o plate -ldl -lm && TOMBOLO_ORDERS=orders.json ./plate libtombolo_catalyst.so pipelines.json
 *
 * The orders move what lies at x below 0.5: at cycle 1 out of the plane, at cycle 3 in it. */
#include <dlfcn.h>

#include "foreign.h"

enum { N = 4, S = N + 1 };
static double along[S], x[S * S], y[S * S];
static int32_t quads[4 * N * N];

static void coordinates(conduit_node* mesh, const double* first, const double* second, int64_t count)
{
  array(mesh, "coordsets/coords/values/x", FLOAT64, first, count, 0, 0);
  array(mesh, "coordsets/coords/values/y", FLOAT64, second, count, 0, 0);
}

int main(int argc, char** argv)
{
  void* library = argc > 2 ? dlopen(argv[1], RTLD_LAZY | RTLD_GLOBAL) : NULL;
  const struct catalyst_impl* impl = library ? dlsym(library, "catalyst_api_impl") : NULL;
  if (impl == NULL) return 2;
  for (int v = 0; v < S * S; ++v) {
    x[v] = (double)(v % S) / N;
    y[v] = (double)(v / S) / N;
    along[v % S] = x[v];
  }
  for (int q = 0; q < N * N; ++q) {
    const int32_t low = q % N + q / N * S, corners[4] = { low, low + 1, low + S + 1, low + S };
    memcpy(quads + 4 * q, corners, sizeof corners);
  }
  static const char* kinds[] = { "explicit", "rectilinear", "uniform" };
  for (int kind = 0; kind < 3; ++kind) {
    static conduit_node setup, node, results;
    text(&setup, "catalyst/scripts/script", argv[2]);
    if (impl->initialize(&setup) != 0) return 1;
    text(&node, "catalyst/channels/box/type", "mesh");
    conduit_node* mesh = at(&node, "catalyst/channels/box/data");
    text(mesh, "coordsets/coords/type", kinds[kind]);
    text(mesh, "topologies/mesh/type", kind ? kinds[kind] : "unstructured");
    text(mesh, "topologies/mesh/coordset", "coords");
    if (kind == 0) {
      coordinates(mesh, x, y, S * S);
      text(mesh, "topologies/mesh/elements/shape", "quad");
      array(mesh, "topologies/mesh/elements/connectivity", INT32, quads, 4 * N * N, 0, 0);
    } else if (kind == 1) {
      coordinates(mesh, along, along, S);
    } else {
      integer(mesh, "coordsets/coords/dims/i", S);
      integer(mesh, "coordsets/coords/dims/j", S);
      number(mesh, "coordsets/coords/spacing/dx", 1.0 / N);
      number(mesh, "coordsets/coords/spacing/dy", 1.0 / N);
    }
    for (int cycle = 0; cycle < 4; ++cycle) {
      integer(&node, "catalyst/state/timestep", cycle);
      number(&node, "catalyst/state/time", 0.1 * cycle);
      if (impl->execute(&node) != 0 || impl->results(&results) != 0) return 1;
      if (catalyst_conduit_node_has_path(&results, "catalyst/box") != (cycle == 3)) {
        fprintf(stderr, "%s coordinates, cycle %d: the mesh is to move at cycle 3 alone\n", kinds[kind], cycle);
        return 1;
      }
    }
    if (impl->finalize(&setup) != 0) return 1;
    clear(&setup);
    clear(&node);
    clear(&results);
  }
  return 0;
}
