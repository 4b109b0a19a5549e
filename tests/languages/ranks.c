/* Ranks that go wrong by themselves, and ranks without data: no rank waits for another, all get the same answer. On three ranks. */
#include <catalyst.h>
#include <mpi.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

static int rank;

/* All ranks have this answer. */
static void expect(const char* what, int status, int wanted)
{
  int least, most;
  MPI_Allreduce(&status, &least, 1, MPI_INT, MPI_MIN, MPI_COMM_WORLD);
  MPI_Allreduce(&status, &most, 1, MPI_INT, MPI_MAX, MPI_COMM_WORLD);
  if (rank == 0) fprintf(stderr, "-- %s\n", what);
  if (least != wanted || most != wanted) {
    fprintf(stderr, "%s: %d to %d where %d is expected\n", what, least, most, wanted);
    MPI_Abort(MPI_COMM_WORLD, 1);
  }
}

static conduit_node* grid(conduit_node* channel, const char* path, const int dims[3], double z, double spacing)
{
  static const char* names[3][2] = { { "dims/i", "spacing/dx" }, { "dims/j", "spacing/dy" }, { "dims/k", "spacing/dz" } };
  conduit_node* mesh = conduit_node_fetch(channel, path);
  conduit_node* coords = conduit_node_fetch(mesh, "coordsets/coords");
  conduit_node_set_path_char8_str(coords, "type", "uniform");
  for (int axis = 0; axis < 3; ++axis) {
    conduit_node_set_path_int32(coords, names[axis][0], dims[axis]);
    conduit_node_set_path_float64(coords, names[axis][1], spacing);
  }
  conduit_node_set_path_float64(coords, "origin/x", rank);
  conduit_node_set_path_float64(coords, "origin/z", z);
  conduit_node_set_path_char8_str(mesh, "topologies/mesh/type", "uniform");
  conduit_node_set_path_char8_str(mesh, "topologies/mesh/coordset", "coords");
  return mesh;
}

/* Two blocks, one above the other: where they touch, each rank has two vertices. */
static void touching(conduit_node* channels)
{
  conduit_node* channel = conduit_node_fetch(channels, "touching");
  conduit_node_set_path_char8_str(channel, "type", "multimesh");
  const int dims[3] = { 2, 2, 2 };
  grid(channel, "data/low", dims, 0.0, 1.0);
  grid(channel, "data/high", dims, 1.0, 1.0);
}

/* Two cells, the upper one covered by eight finer ones. */
static void levels(conduit_node* channels)
{
  conduit_node* channel = conduit_node_fetch(channels, "levels");
  conduit_node_set_path_char8_str(channel, "type", "amrmesh");
  const int coarse[3] = { 2, 2, 3 }, fine[3] = { 3, 3, 3 };
  for (int level = 0; level < 2; ++level) {
    conduit_node* mesh = grid(channel, level ? "data/fine" : "data/coarse", level ? fine : coarse, level, level ? 0.5 : 1.0);
    conduit_node_set_path_int32(mesh, "state/domain_id", 2 * rank + level);
    conduit_node_set_path_int32(mesh, "state/level", level);
  }
}

/* Two coarse cells on rank 0, one of them covered by eight finer ones of rank 1. */
static void across(conduit_node* channels)
{
  conduit_node* channel = conduit_node_fetch(channels, "across");
  conduit_node_set_path_char8_str(channel, "type", "amrmesh");
  const int coarse[3] = { 3, 2, 2 }, fine[3] = { 3, 3, 3 };
  conduit_node* mesh = grid(channel, rank ? "data/fine" : "data/coarse", rank ? fine : coarse, 0.0, rank ? 0.5 : 1.0);
  conduit_node_set_path_int32(mesh, "state/domain_id", rank);
  conduit_node_set_path_int32(mesh, "state/level", rank);
  const float held[1] = { 0.5f };
  conduit_node_set_path_float32_ptr(mesh, "state/fields/held", (float*)held, 1);
  conduit_uint8 levels[8];
  for (int cell = 0; cell < 8; ++cell) levels[cell] = (conduit_uint8)rank;
  conduit_node_set_path_char8_str(mesh, "fields/level/association", "element");
  conduit_node_set_path_char8_str(mesh, "fields/level/topology", "mesh");
  conduit_node_set_path_uint8_ptr(mesh, "fields/level/values", levels, rank ? 8 : 2);
}

/* Points alone, which have no surface, at the same places on each rank. */
static void drops(conduit_node* channels)
{
  conduit_node* channel = conduit_node_fetch(channels, "drops");
  conduit_node_set_path_char8_str(channel, "type", "mesh");
  const double at[2] = { 0.0, 0.5 };
  conduit_node_set_path_char8_str(channel, "data/coordsets/coords/type", "explicit");
  conduit_node_set_path_float64_ptr(channel, "data/coordsets/coords/values/x", (double*)at, 2);
  conduit_node_set_path_char8_str(channel, "data/topologies/mesh/type", "points");
  conduit_node_set_path_char8_str(channel, "data/topologies/mesh/coordset", "coords");
}

/* Grids of each kind: one cube on ranks 0 and 1, and none on rank 2, which says so by counts of 0. */
static void grids(conduit_node* channels)
{
  static const char* kinds[3] = { "uniform", "rectilinear", "structured" };
  static const char* values[3] = { "values/x", "values/y", "values/z" };
  static const char* counts[3] = { "elements/dims/i", "elements/dims/j", "elements/dims/k" };
  const double ends[2] = { 0.0, 1.0 };
  for (int kind = 0; kind < 3; ++kind) {
    conduit_node* channel = conduit_node_fetch(channels, kinds[kind]);
    conduit_node_set_path_char8_str(channel, "type", "mesh");
    if (kind == 0) {
      const int some[3] = { 2, 2, 2 }, none[3] = { 0, 0, 0 };
      grid(channel, "data", rank < 2 ? some : none, 0.0, 1.0);
      continue;
    }
    conduit_node* coords = conduit_node_fetch(channel, "data/coordsets/coords");
    conduit_node* topology = conduit_node_fetch(channel, "data/topologies/mesh");
    conduit_node_set_path_char8_str(coords, "type", kind == 1 ? "rectilinear" : "explicit");
    conduit_node_set_path_char8_str(topology, "type", kinds[kind]);
    conduit_node_set_path_char8_str(topology, "coordset", "coords");
    for (int axis = 0; axis < 3; ++axis) {
      if (kind == 2) {
        double corners[8];
        for (int v = 0; v < 8; ++v) corners[v] = ends[v >> axis & 1];
        conduit_node_set_path_float64_ptr(coords, values[axis], corners, rank < 2 ? 8 : 0);
        conduit_node_set_path_int32(topology, counts[axis], rank < 2);
      } else {
        /* Without points along x there are none, whatever the other axes have. */
        conduit_node_set_path_float64_ptr(coords, values[axis], (double*)ends, rank == 2 && axis == 0 ? 0 : 2);
      }
    }
  }
}

static double points[24];
static const int32_t hex[8] = { 0, 1, 3, 2, 4, 5, 7, 6 };
static double heat[8];

/* Whether the channel's cubes are blocks. */
static int has_blocks;

/* Rank 2 has no cells. It does not even name the channels but for the grids; of blocks it says no more than the channel's type. */
static conduit_node* step(int cycle)
{
  conduit_node* node = conduit_node_create();
  conduit_node_set_path_int32(node, "catalyst/state/timestep", cycle);
  conduit_node_set_path_float64(node, "catalyst/state/time", cycle);
  if (rank == 2 && !has_blocks) {
    grids(conduit_node_fetch(node, "catalyst/channels"));
    return node;
  }
  conduit_node* channel = conduit_node_fetch(node, "catalyst/channels/solid");
  conduit_node_set_path_char8_str(channel, "type", has_blocks ? "multimesh" : "mesh");
  if (rank == 2) return node;
  conduit_node* mesh = conduit_node_fetch(channel, has_blocks ? "data/cube" : "data");
  conduit_node_set_path_char8_str(mesh, "coordsets/coords/type", "explicit");
  const char* axes[] = { "x", "y", "z" };
  for (int axis = 0; axis < 3; ++axis) {
    char path[64];
    snprintf(path, sizeof path, "coordsets/coords/values/%s", axes[axis]);
    conduit_node_set_path_external_float64_ptr_detailed(mesh, path, points, 8, 8 * axis, 24, 8, 0);
  }
  conduit_node_set_path_char8_str(mesh, "topologies/mesh/type", "unstructured");
  conduit_node_set_path_char8_str(mesh, "topologies/mesh/coordset", "coords");
  conduit_node_set_path_char8_str(mesh, "topologies/mesh/elements/shape", "hex");
  conduit_node_set_path_external_int32_ptr(mesh, "topologies/mesh/elements/connectivity", (int32_t*)hex, 8);
  conduit_node_set_path_char8_str(mesh, "fields/heat/association", "vertex");
  conduit_node_set_path_char8_str(mesh, "fields/heat/topology", "mesh");
  conduit_node_set_path_external_float64_ptr(mesh, "fields/heat/values", heat, 8);
  if (has_blocks) return node;
  touching(conduit_node_fetch(node, "catalyst/channels"));
  levels(conduit_node_fetch(node, "catalyst/channels"));
  across(conduit_node_fetch(node, "catalyst/channels"));
  drops(conduit_node_fetch(node, "catalyst/channels"));
  grids(conduit_node_fetch(node, "catalyst/channels"));
  return node;
}

static int run(conduit_node* node)
{
  const int status = (int)catalyst_execute(node);
  conduit_node_destroy(node);
  return status;
}

/* An order moves blocks; the rank without one finds what the others do, without a mesh. */
static void blocks_that_move(conduit_node* setup)
{
  has_blocks = 1;
  expect("initialize with blocks", (int)catalyst_initialize(setup), 0);
  for (int cycle = 0; cycle < 3; ++cycle) expect("a step of blocks", run(step(cycle)), 0);
  conduit_node* results = conduit_node_create();
  expect("results of blocks", (int)catalyst_results(results), 0);
  const int is_multimesh = conduit_node_has_path(results, "catalyst/solid/type") &&
    strcmp(conduit_node_fetch_path_as_char8_str(results, "catalyst/solid/type"), "multimesh") == 0;
  expect("blocks that move, of every rank", is_multimesh, 1);
  const int has_cube = conduit_node_has_path(results, "catalyst/solid/cube/coordsets/coords/values/x");
  expect("a cube of each rank that has one", has_cube == (rank < 2) && !conduit_node_has_path(results, "catalyst/solid/coordsets"), 1);
  expect("finalize with blocks", (int)catalyst_finalize(setup), 0);
  conduit_node_destroy(results);
  conduit_node_destroy(setup);
}

int main(int argc, char** argv)
{
  MPI_Init(&argc, &argv);
  MPI_Comm_rank(MPI_COMM_WORLD, &rank);
  for (int v = 0; v < 8; ++v) {
    points[3 * v] = rank + (v & 1);
    points[3 * v + 1] = v >> 1 & 1;
    points[3 * v + 2] = v >> 2;
    heat[v] = points[3 * v];
  }
  conduit_node* setup = conduit_node_create();
  conduit_node_set_path_int32(setup, "catalyst/mpi_comm", MPI_Comm_c2f(MPI_COMM_WORLD));
  if (argc > 1) {
    blocks_that_move(setup);
    MPI_Finalize();
    return 0;
  }
  conduit_node* wrong = conduit_node_create();
  conduit_node_set_node(wrong, setup);
  if (rank == 1) conduit_node_set_path_char8_str(wrong, "catalyst/scripts/a/filename", "no-such-file.json");
  expect("a configuration that rank 1 cannot read", (int)catalyst_initialize(wrong), 100);
  expect("initialize", (int)catalyst_initialize(setup), 0);

  expect("a rank without data", run(step(0)), 0);
  conduit_node* node = step(1);
  if (rank == 1) conduit_node_set_path_char8_str(node, "catalyst/channels/solid/data/topologies/mesh/elements/shape", "cube");
  expect("a shape that rank 1 alone gets wrong", run(node), 100);
  node = step(1);
  if (rank == 0) {
    /* Without what was there Conduit would go on in the longer array. */
    conduit_node_remove_path(node, "catalyst/channels/solid/data/fields/heat/values");
    conduit_node_set_path_float64_ptr(node, "catalyst/channels/solid/data/fields/heat/values", heat, 7);
  }
  expect("a field that is too short on rank 0", run(node), 100);
  node = step(1);
  if (rank == 2) conduit_node_remove_path(node, "catalyst/state/time");
  expect("no time on rank 2", run(node), 100);
  expect("a sound step after that", run(step(1)), 0);
  expect("and another", run(step(2)), 0);
  conduit_node* results = conduit_node_create();
  expect("results", (int)catalyst_results(results), 0);
  /* An order moves the cubes; the rank without one finds a mesh of no points. */
  const int is_mesh = conduit_node_has_path(results, "catalyst/solid/coordsets/coords/values/x") &&
    conduit_node_has_path(results, "catalyst/solid/data/fields/displacement/values/z") &&
    strcmp(conduit_node_fetch_path_as_char8_str(results, "catalyst/solid/type"), "mesh") == 0;
  expect("a mesh that moves, of every rank", is_mesh, 1);
  const int ended = (int)catalyst_finalize(setup);
  /* Looked for at once, on every rank. */
  const int missing = access("surface-000002.vtp", F_OK) != 0 || access("last-000002.vtu", F_OK) != 0;
  expect("finalize", ended, 0);
  expect("files that are not there after finalize", missing, 0);
  conduit_node_destroy(results);
  conduit_node_destroy(setup);
  conduit_node_destroy(wrong);
  MPI_Finalize();
  return 0;
}
