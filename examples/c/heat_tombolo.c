/* Heat, instrumented by tombolo.h.
 *
 *   mpirun -n 3 heat_tombolo [STEPS [CELLS [MILLISECONDS-PER-STEP]]]
 *
 * TOMBOLO_PIPELINES names what to watch (else the surface is streamed), TOMBOLO_ORDERS orders known beforehand. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <tombolo.h>

#include "heat.h"

static void check(int status)
{
  if (status == TOMBOLO_OK) return;
  fprintf(stderr, "%s\n", tombolo_message());
  MPI_Abort(MPI_COMM_WORLD, 1);
}

static const char* const watch_the_surface =
  "{\"version\": 1, \"stream\": {\"listen\": \"127.0.0.1:0\"},"
  " \"pipelines\": [{\"name\": \"surface\", \"stages\": [{\"surface\": {}}, {\"stream\": {}}]}]}";

int main(int argc, char** argv)
{
  MPI_Init(&argc, &argv);
  const long steps = argc > 1 ? atol(argv[1]) : 100;
  const int cells = argc > 2 ? atoi(argv[2]) : 6;
  const long pace = argc > 3 ? atol(argv[3]) : 0;
  const double time_step = 1e-3;
  double conductivity = 0.5;
  heat solver = heat_create(MPI_COMM_WORLD, cells);

  tombolo* run = tombolo_create();
  const char* pipelines = getenv("TOMBOLO_PIPELINES");
  check(pipelines ? tombolo_configure_file(run, pipelines) : tombolo_configure(run, watch_the_surface));
  if (getenv("TOMBOLO_ORDERS")) check(tombolo_orders_file(run, getenv("TOMBOLO_ORDERS")));
  check(tombolo_communicator(run, MPI_Comm_c2f(MPI_COMM_WORLD)));
  check(tombolo_parameter(run, "conductivity", conductivity, 0.0, 1.0));
  check(tombolo_initialize(run));
  char link[256];
  check(tombolo_link(run, link, sizeof link));
  if (*link) fprintf(stderr, "open %s\n", link);

  /* The arrays stay the solver's: nothing is copied. */
  static const char* const names[6] = { "x-min", "x-max", "y-min", "y-max", "z-min", "z-max" };
  check(tombolo_mesh(run, "solid", TOMBOLO_FLOAT64, solver.coordinates, (size_t)solver.vertices, 3, 3));
  check(tombolo_cells(run, "solid", TOMBOLO_TETRA, TOMBOLO_INT32, solver.connectivity, (size_t)solver.tets));
  check(tombolo_faces(
    run, "solid", TOMBOLO_TRIANGLE, TOMBOLO_INT32, solver.triangles, solver.features, (size_t)solver.faces));
  for (int feature = 0; feature < 6; ++feature) check(tombolo_feature(run, "solid", feature + 1, names[feature]));
  check(tombolo_global_numbers(run, "solid", TOMBOLO_INT64, solver.numbers, NULL));
  check(tombolo_field(run, "solid", "temperature", TOMBOLO_VERTEX, TOMBOLO_FLOAT64, solver.temperature, 1, 1));

  for (long step = 0; step < steps; ++step) {
    check(tombolo_execute(run, (uint64_t)step, time_step * (double)step, time_step));
    check(tombolo_parameter_value(run, "conductivity", &conductivity));
    if (tombolo_stopped(run)) break;
    const size_t bytes = 3 * sizeof(double) * (size_t)solver.vertices;
    const double* coordinates = tombolo_coordinates(run);
    if (coordinates) memcpy(solver.velocity, tombolo_velocity(run), bytes);
    else memset(solver.velocity, 0, bytes);
    heat_step(&solver, conductivity, time_step);
    if (coordinates) memcpy(solver.coordinates, coordinates, bytes);
    const struct timespec wait = { pace / 1000, pace % 1000 * 1000000 };
    nanosleep(&wait, NULL);
  }
  const double volume = heat_volume(&solver), mean = heat_mean(&solver);
  if (solver.rank == 0) printf("volume %.12f mean temperature %.12f conductivity %g\n", volume, mean, conductivity);

  check(tombolo_finalize(run));
  for (size_t index = 0; index < tombolo_order_count(run); ++index) {
    char order[1024];
    check(tombolo_order(run, index, order, sizeof order));
    if (solver.rank == 0) printf("%s\n", order);
  }
  tombolo_destroy(run);
  heat_destroy(&solver);
  MPI_Finalize();
  return 0;
}
