/* Heat, instrumented by Catalyst 2.
 *
 *   export CATALYST_IMPLEMENTATION_NAME=tombolo
 *   mpirun -n 3 heat_catalyst [STEPS [CELLS [MILLISECONDS-PER-STEP]]]
 *
 * TOMBOLO_PIPELINES names what to watch (else the surface is streamed), TOMBOLO_ORDERS orders known beforehand. */
#include <catalyst.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "heat.h"

static void check(enum catalyst_status status, const char* call)
{
  if (status == catalyst_status_ok) return;
  fprintf(stderr, "%s answers %d\n", call, (int)status);
  MPI_Abort(MPI_COMM_WORLD, 1);
}

/* Tells Catalyst of the arrays, which stay the solver's: nothing is copied. */
static void describe(conduit_node* node, const heat* solver)
{
  conduit_node* channel = conduit_node_fetch(node, "catalyst/channels/solid");
  conduit_node_set_path_char8_str(channel, "type", "mesh");
  static const char* const names[6] = { "x-min", "x-max", "y-min", "y-max", "z-min", "z-max" };
  for (int feature = 0; feature < 6; ++feature) {
    char path[32];
    snprintf(path, sizeof path, "state/features/%s", names[feature]);
    conduit_node_set_path_int32(channel, path, feature + 1);
  }

  conduit_node* mesh = conduit_node_fetch(channel, "data");
  const conduit_index_t vertices = solver->vertices, bytes = sizeof(double);
  conduit_node_set_path_char8_str(mesh, "coordsets/coords/type", "explicit");
  static const char* const axes[3] = { "x", "y", "z" };
  for (int axis = 0; axis < 3; ++axis) {
    char path[64];
    snprintf(path, sizeof path, "coordsets/coords/values/%s", axes[axis]);
    conduit_node_set_path_external_float64_ptr_detailed(
      mesh, path, solver->coordinates, vertices, axis * bytes, 3 * bytes, bytes, CONDUIT_ENDIANNESS_DEFAULT_ID);
  }

  conduit_node_set_path_char8_str(mesh, "topologies/mesh/type", "unstructured");
  conduit_node_set_path_char8_str(mesh, "topologies/mesh/coordset", "coords");
  conduit_node_set_path_char8_str(mesh, "topologies/mesh/elements/shape", "tet");
  conduit_node_set_path_external_int32_ptr(
    mesh, "topologies/mesh/elements/connectivity", solver->connectivity, 4 * solver->tets);
  conduit_node_set_path_char8_str(mesh, "topologies/boundary/type", "unstructured");
  conduit_node_set_path_char8_str(mesh, "topologies/boundary/coordset", "coords");
  conduit_node_set_path_char8_str(mesh, "topologies/boundary/elements/shape", "tri");
  conduit_node_set_path_external_int32_ptr(
    mesh, "topologies/boundary/elements/connectivity", solver->triangles, 3 * solver->faces);

  conduit_node_set_path_char8_str(mesh, "fields/temperature/association", "vertex");
  conduit_node_set_path_char8_str(mesh, "fields/temperature/topology", "mesh");
  conduit_node_set_path_external_float64_ptr(mesh, "fields/temperature/values", solver->temperature, vertices);
  /* Which side of the box each face belongs to, so that it can be seized by its name. */
  conduit_node_set_path_char8_str(mesh, "fields/boundary_attribute/association", "element");
  conduit_node_set_path_char8_str(mesh, "fields/boundary_attribute/topology", "boundary");
  conduit_node_set_path_external_int32_ptr(mesh, "fields/boundary_attribute/values", solver->features, solver->faces);
  /* The vertices' numbers in the whole box: what ranks share is known by them. */
  conduit_node_set_path_char8_str(mesh, "fields/number/association", "vertex");
  conduit_node_set_path_char8_str(mesh, "fields/number/topology", "mesh");
  conduit_node_set_path_external_int64_ptr(mesh, "fields/number/values", solver->numbers, vertices);
  conduit_node_set_path_char8_str(mesh, "state/metadata/vtk_fields/number/attribute_type", "GlobalIds");
}

/* Does what the results ask; answers whether the run is to end. */
static int obey(conduit_node* results, heat* solver, double** coordinates, double* conductivity)
{
  *coordinates = NULL;
  memset(solver->velocity, 0, 3 * sizeof(double) * (size_t)solver->vertices);
  if (conduit_node_has_path(results, "catalyst/solid/coordsets/coords") && solver->vertices > 0) {
    *coordinates = malloc(3 * sizeof(double) * (size_t)solver->vertices);
    static const char* const axes[3] = { "x", "y", "z" };
    for (int axis = 0; axis < 3; ++axis) {
      char path[64];
      snprintf(path, sizeof path, "catalyst/solid/coordsets/coords/values/%s", axes[axis]);
      const double* to = conduit_node_fetch_path_as_float64_ptr(results, path);
      snprintf(path, sizeof path, "catalyst/solid/fields/velocity/values/%s", axes[axis]);
      const double* velocity = conduit_node_fetch_path_as_float64_ptr(results, path);
      for (int v = 0; v < solver->vertices; ++v) {
        (*coordinates)[3 * v + axis] = to[v];
        solver->velocity[3 * v + axis] = velocity[v];
      }
    }
  }
  /* An implementation that steers nothing leaves these out. */
  if (conduit_node_has_path(results, "catalyst/steering/fields/conductivity/values"))
    *conductivity = conduit_node_fetch_path_as_float64(results, "catalyst/steering/fields/conductivity/values");
  return conduit_node_has_path(results, "catalyst/steering/fields/stop/values") &&
    conduit_node_fetch_path_as_float64(results, "catalyst/steering/fields/stop/values") != 0.0;
}

int main(int argc, char** argv)
{
  MPI_Init(&argc, &argv);
  const long steps = argc > 1 ? atol(argv[1]) : 100;
  const int cells = argc > 2 ? atoi(argv[2]) : 6;
  const long pace = argc > 3 ? atol(argv[3]) : 0;
  const double time_step = 1e-3;
  double conductivity = 0.5;
  heat solver = heat_create(MPI_COMM_WORLD, cells);

  conduit_node* setup = conduit_node_create();
  conduit_node_set_path_int32(setup, "catalyst/mpi_comm", MPI_Comm_c2f(MPI_COMM_WORLD));
  conduit_node_set_path_float64(setup, "catalyst/parameters/conductivity/value", conductivity);
  conduit_node_set_path_float64(setup, "catalyst/parameters/conductivity/minimum", 0.0);
  conduit_node_set_path_float64(setup, "catalyst/parameters/conductivity/maximum", 1.0);
  check(catalyst_initialize(setup), "catalyst_initialize");

  conduit_node* node = conduit_node_create();
  describe(node, &solver);
  conduit_node* results = conduit_node_create();
  for (long step = 0; step < steps; ++step) {
    conduit_node_set_path_int64(node, "catalyst/state/timestep", step);
    conduit_node_set_path_float64(node, "catalyst/state/time", time_step * (double)step);
    conduit_node_set_path_float64(node, "catalyst/state/time_step", time_step);
    check(catalyst_execute(node), "catalyst_execute");
    check(catalyst_results(results), "catalyst_results");
    double* coordinates;
    const int stop = obey(results, &solver, &coordinates, &conductivity);
    if (stop) break;
    heat_step(&solver, conductivity, time_step);
    if (coordinates != NULL) {
      memcpy(solver.coordinates, coordinates, 3 * sizeof(double) * (size_t)solver.vertices);
      free(coordinates);
    }
    const struct timespec wait = { pace / 1000, pace % 1000 * 1000000 };
    nanosleep(&wait, NULL);
  }
  const double volume = heat_volume(&solver), mean = heat_mean(&solver);
  if (solver.rank == 0) printf("volume %.12f mean temperature %.12f conductivity %g\n", volume, mean, conductivity);

  check(catalyst_finalize(setup), "catalyst_finalize");
  conduit_node_destroy(setup);
  conduit_node_destroy(node);
  conduit_node_destroy(results);
  heat_destroy(&solver);
  MPI_Finalize();
  return 0;
}
