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

  tombolo* run;
  const char *pipelines = getenv("TOMBOLO_PIPELINES"), *orders = getenv("TOMBOLO_ORDERS");
  check(tombolo_open(pipelines, MPI_Comm_c2f(MPI_COMM_WORLD), &run));
  if (!pipelines) check(tombolo_configure(run, watch_the_surface));
  if (orders) check(tombolo_orders_file(run, orders));
  check(tombolo_parameter(run, "conductivity", conductivity, 0.0, 1.0));
  check(tombolo_start(run));
  if (tombolo_link(run)) fprintf(stderr, "open %s\n", tombolo_link(run));

  /* The arrays stay the solver's: nothing is copied. */
  static const char* const names[6] = { "x-min", "x-max", "y-min", "y-max", "z-min", "z-max" };
  const size_t points = (size_t)solver.vertices;
  check(tombolo_points_f64(run, "solid", solver.coordinates, points));
  check(tombolo_cells_i32(run, "solid", TOMBOLO_TETRA, solver.connectivity, (size_t)solver.tets));
  check(tombolo_faces_i32(run, "solid", TOMBOLO_TRIANGLE, solver.triangles, solver.features, (size_t)solver.faces));
  for (int side = 0; side < 6; ++side) check(tombolo_feature(run, "solid", side + 1, names[side]));
  check(tombolo_global_vertices_i64(run, "solid", solver.numbers, points));
  check(tombolo_field_f64(run, "solid", "temperature", TOMBOLO_VERTEX, solver.temperature, points, 1));

  for (long step = 0; step < steps; ++step) {
    check(tombolo_execute(run, (uint64_t)step, time_step * (double)step, time_step));
    check(tombolo_parameter_value(run, "conductivity", &conductivity));
    if (tombolo_stopped(run)) break;
    const size_t bytes = 3 * sizeof(double) * points;
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
  for (size_t index = 0; solver.rank == 0 && index < tombolo_order_count(run); ++index)
    printf("%s\n", tombolo_order(run, index));
  check(tombolo_close(&run));
  heat_destroy(&solver);
  MPI_Finalize();
  return 0;
}
