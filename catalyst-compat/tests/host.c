/* A host that speaks Catalyst 2 over a Conduit of its own, and gets everything wrong that can be got wrong.
 *
 *   cc -rdynamic host.c -o host -ldl -lm && ./host libtombolo_catalyst.so
 *
 * Exits with 0 when every answer is the one expected; else prints the first that is not and exits with 1. */
#include <dlfcn.h>
#include <math.h>
#include <sys/mman.h>

#include "foreign.h"

static void expect(const char* what, int found, int wanted)
{
  fprintf(stderr, "-- %s\n", what);
  if (found != wanted) {
    fprintf(stderr, "%s: %d where %d is expected\n", what, found, wanted);
    exit(1);
  }
}

static void expect_text(conduit_node* node, const char* path, const char* wanted)
{
  conduit_node* found = walk(node, path, 0);
  if (!found || found->type.id != TEXT || strcmp(found->data, wanted) != 0) {
    fprintf(stderr, "%s: not '%s'\n", path, wanted);
    exit(1);
  }
}

static double xyz[12] = { 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1 };
static int32_t tet[4] = { 0, 1, 2, 3 };
static double temperature[4] = { 1, 2, 3, 4 };

/* A whole step of one tetrahedron, and the way to what a case spoils. */
static conduit_node* step(conduit_node* node)
{
  static int64_t cycle = 0;
  clear(node);
  integer(node, "catalyst/state/timestep", ++cycle);
  number(node, "catalyst/state/time", 0.1 * (double)cycle);
  text(node, "catalyst/channels/grid/type", "mesh");
  conduit_node* mesh = at(node, "catalyst/channels/grid/data");
  unstructured(mesh, "tet", xyz, 4, tet, 4);
  text(mesh, "fields/temperature/association", "vertex");
  text(mesh, "fields/temperature/topology", "mesh");
  array(mesh, "fields/temperature/values", FLOAT64, temperature, 4, 0, 0);
  return mesh;
}

int main(int argc, char** argv)
{
  void* library = argc > 1 ? dlopen(argv[1], RTLD_LAZY | RTLD_GLOBAL) : NULL;
  if (library == NULL) {
    fprintf(stderr, "%s\n", argc > 1 ? dlerror() : "which library?");
    return 1;
  }
  const struct catalyst_impl* impl = dlsym(library, "catalyst_api_impl");
  if (impl == NULL) {
    fprintf(stderr, "catalyst_api_impl is not exported\n");
    return 1;
  }
  expect("version", impl->version, 1);
  static conduit_node about, empty, node;
  expect("about before initialize", impl->about(&about), 0);
  expect_text(&about, "catalyst/version", "2.0.0");
  expect_text(&about, "catalyst/abi_version", "3");
  expect_text(&about, "catalyst/implementation", "tombolo");
  expect("catalyst/use_mpi", catalyst_conduit_node_has_path(&about, "catalyst/use_mpi"), 1);
  expect("about(NULL)", impl->about(NULL), 100);

  expect("execute before initialize", impl->execute(&empty), 1);
  expect("results before initialize", impl->results(&empty), 1);
  expect("finalize before initialize", impl->finalize(&empty), 1);
  expect("initialize(NULL)", impl->initialize(NULL), 100);
  static conduit_node setup;
  text(&setup, "catalyst/scripts/script/filename", "no-such-file.json");
  expect("a configuration that is not there", impl->initialize(&setup), 100);
  clear(&setup);
  text(&setup, "catalyst/pipelines/0/type", "oi");
  text(&setup, "catalyst/pipelines/0/filename", "x.vtu");
  expect("a pipeline of an unknown type", impl->initialize(&setup), 100);
  clear(&setup);
  text(&setup, "catalyst/mpi_comm", "world");
  expect("a communicator in words", impl->initialize(&setup), 100);
  /* By the communicator the ranks are told what else is wrong, so that it is read first. */
  text(&setup, "catalyst/pipelines/0/type", "oi");
  text(&setup, "catalyst/pipelines/0/filename", "x.vtu");
  expect("a communicator in words and a pipeline of an unknown type", impl->initialize(&setup), 100);
  expect("what failed did not initialize", impl->execute(&empty), 1);
  expect("initialize", impl->initialize(&empty), 0);
  expect("a second initialize", impl->initialize(&empty), 0);

  expect("execute(NULL)", impl->execute(NULL), 100);
  expect("execute without catalyst", impl->execute(&empty), 100);
  step(&node);
  expect("a step", impl->execute(&node), 0);

  const int64_t integers[] = { INT32, INT64, UINT32, UINT64, FLOAT64 };
  const union { int32_t a; int64_t b; } seven = { .b = 700 };
  const double real_seven = 700.0;
  for (int i = 0; i < 5; ++i) {
    step(&node);
    array(&node, "catalyst/state/timestep", integers[i], i == 4 ? (const void*)&real_seven : &seven, 1, 0, 0);
    expect("a timestep of each type", impl->execute(&node), 0);
  }

  step(&node);
  catalyst_conduit_node_remove_path(&node, "catalyst/state/time");
  expect("no time", impl->execute(&node), 100);
  step(&node);
  integer(&node, "catalyst/state/timestep", -1);
  expect("a negative cycle", impl->execute(&node), 100);
  step(&node);
  text(&node, "catalyst/state/timestep", "seven");
  expect("a cycle in words", impl->execute(&node), 100);
  step(&node);
  number(&node, "catalyst/state/time", NAN);
  expect("a time that is NaN", impl->execute(&node), 100);
  step(&node);
  integer(&node, "catalyst/state/timestep/deeper", 1);
  expect("a cycle that is an object", impl->execute(&node), 100);
  step(&node);
  catalyst_conduit_node_remove_path(&node, "catalyst/channels");
  expect("no channels yet", impl->execute(&node), 0);

  step(&node);
  text(&node, "catalyst/channels/grid/type", "msh");
  expect("a channel of an unknown type", impl->execute(&node), 100);
  step(&node);
  text(&node, "catalyst/channels/grid/memoryspace", "cuda");
  expect("a graphics card's memory, as a flag", impl->execute(&node), 100);
  conduit_node* mesh = step(&node);
  text(mesh, "coordsets/coords/type", "explicid");
  expect("a coordset of an unknown type", impl->execute(&node), 100);
  mesh = step(&node);
  array(mesh, "coordsets/coords/values/y", FLOAT64, xyz, 3, 8, 24);
  expect("coordinates of different lengths", impl->execute(&node), 100);
  mesh = step(&node);
  text(mesh, "topologies/mesh/coordset", "points");
  expect("a coordset that is not there", impl->execute(&node), 100);
  mesh = step(&node);
  text(mesh, "topologies/mesh/elements/shape", "tetrahedron");
  expect("a shape of an unknown name", impl->execute(&node), 100);
  mesh = step(&node);
  array(mesh, "topologies/mesh/elements/connectivity", INT32, tet, 3, 0, 0);
  expect("three quarters of a tetrahedron", impl->execute(&node), 100);
  mesh = step(&node);
  const int32_t beyond[4] = { 0, 1, 2, 4 }, below[4] = { 0, 1, 2, -3 };
  array(mesh, "topologies/mesh/elements/connectivity", INT32, beyond, 4, 0, 0);
  expect("a vertex that does not exist", impl->execute(&node), 100);
  mesh = step(&node);
  array(mesh, "topologies/mesh/elements/connectivity", INT32, below, 4, 0, 0);
  expect("a vertex below 0", impl->execute(&node), 100);
  const int16_t short_beyond[4] = { 0, 1, 2, 4 }, short_below[4] = { 0, 1, 2, -3 };
  mesh = step(&node);
  array(mesh, "topologies/mesh/elements/connectivity", INT16, short_beyond, 4, 0, 0);
  expect("a vertex that does not exist, in cells that are copied", impl->execute(&node), 100);
  mesh = step(&node);
  array(mesh, "topologies/mesh/elements/connectivity", INT16, short_below, 4, 0, 0);
  expect("a vertex below 0, in cells that are copied", impl->execute(&node), 100);
  mesh = step(&node);
  array(mesh, "fields/temperature/values", FLOAT64, temperature, 3, 0, 0);
  expect("a field that is too short", impl->execute(&node), 100);
  mesh = step(&node);
  text(mesh, "fields/temperature/association", "point");
  expect("an unknown association", impl->execute(&node), 100);
  mesh = step(&node);
  catalyst_conduit_node_remove_path(mesh, "fields/temperature/values");
  expect("a field without values", impl->execute(&node), 100);
  mesh = step(&node);
  text(mesh, "fields/temperature/values", "warm");
  expect("a field in words", impl->execute(&node), 100);
  mesh = step(&node);
  array(mesh, "coordsets/coords/values/x", FLOAT64, NULL, 4, 0, 24);
  expect("a null pointer", impl->execute(&node), 100);
  mesh = step(&node);
  array(mesh, "fields/temperature/values", FLOAT64, temperature, INT64_MAX, 0, 0);
  expect("a length that no memory has", impl->execute(&node), 100);
  mesh = step(&node);
  void* page = mmap(NULL, 4096, PROT_NONE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
  array(mesh, "fields/temperature/values", FLOAT64, page, 4, 0, 0);
  expect("memory that cannot be read, as a graphics card's", impl->execute(&node), 100);
  munmap(page, 4096);
  expect("memory that was unmapped", impl->execute(&node), 100);

  step(&node);
  text(&node, "catalyst/channels/uniform/type", "mesh");
  mesh = at(&node, "catalyst/channels/uniform/data");
  text(mesh, "coordsets/coords/type", "uniform");
  for (const char* name = "ijk"; *name; ++name) {
    char path[32];
    snprintf(path, sizeof path, "coordsets/coords/dims/%c", *name);
    integer(mesh, path, 0);
  }
  text(mesh, "topologies/mesh/type", "uniform");
  text(mesh, "topologies/mesh/coordset", "coords");
  text(&node, "catalyst/channels/structured/type", "mesh");
  mesh = at(&node, "catalyst/channels/structured/data");
  text(mesh, "coordsets/coords/type", "explicit");
  text(mesh, "topologies/mesh/type", "structured");
  text(mesh, "topologies/mesh/coordset", "coords");
  for (int axis = 0; axis < 3; ++axis) {
    char path[32];
    snprintf(path, sizeof path, "coordsets/coords/values/%c", 'x' + axis);
    array(mesh, path, FLOAT64, xyz, 0, 0, 0);
    snprintf(path, sizeof path, "topologies/mesh/elements/dims/%c", 'i' + axis);
    integer(mesh, path, 0);
  }
  expect("grids without points", impl->execute(&node), 0);
  array(mesh, "coordsets/coords/values/x", FLOAT64, xyz, 0, 0, 0);
  for (int axis = 0; axis < 3; ++axis) {
    char path[48];
    snprintf(path, sizeof path, "topologies/mesh/elements/dims/%c", 'i' + axis);
    integer(mesh, path, 2);
  }
  expect("cells of a grid without points", impl->execute(&node), 100);

  step(&node);
  expect("a sound step after all that", impl->execute(&node), 0);
  expect("results", impl->results(&empty), 0);
  expect("results say that nothing moves",
    catalyst_conduit_node_has_path(&empty, "catalyst/steering/fields/moving/values") &&
      !catalyst_conduit_node_has_path(&empty, "catalyst/grid"), 1);
  expect("results(NULL)", impl->results(NULL), 100);
  expect("finalize(NULL)", impl->finalize(NULL), 100);
  expect("finalize", impl->finalize(&empty), 0);
  expect("execute after finalize", impl->execute(&node), 1);
  clear(&empty);
  expect("initialize after finalize", impl->initialize(&empty), 0);
  expect("finalize again", impl->finalize(&empty), 0);

  /* Somebody could steer now; then the solver makes another mesh of it, with another number of vertices in the end. */
  clear(&setup);
  text(&setup, "catalyst/scripts/script/filename", argc > 2 ? argv[2] : "");
  expect("initialize with a server", impl->initialize(&setup), 0);
  step(&node);
  expect("the mesh that shapes are measured from", impl->execute(&node), 0);
  const int32_t other[8] = { 0, 1, 2, 3, 1, 0, 2, 3 };
  mesh = step(&node);
  array(mesh, "topologies/mesh/elements/connectivity", INT32, other, 8, 0, 0);
  expect("another mesh", impl->execute(&node), 0);
  mesh = step(&node);
  double more[15] = { 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1, 1, 1, 1 };
  double warm[5] = { 0 };
  array(mesh, "coordsets/coords/values/x", FLOAT64, more, 5, 0, 24);
  array(mesh, "coordsets/coords/values/y", FLOAT64, more, 5, 8, 24);
  array(mesh, "coordsets/coords/values/z", FLOAT64, more, 5, 16, 24);
  array(mesh, "fields/temperature/values", FLOAT64, warm, 5, 0, 0);
  expect("and one more vertex", impl->execute(&node), 0);
  expect("finalize the last", impl->finalize(&setup), 0);
  clear(&about);
  clear(&setup);
  clear(&node);
  return 0;
}
