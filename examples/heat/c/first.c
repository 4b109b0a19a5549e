/* The smallest whole solver: a box of cubes that cools down, watched and reshaped in a browser while it runs.
 *   cc first.c -o first $(pkg-config --cflags --libs tombolo) && ./first [pipelines.json [STEPS]] */
#include <stdio.h>
#include <stdlib.h>
#include <tombolo.h>
enum { N = 8, S = N + 1, POINTS = S * S * S, CUBES = N * N * N };
static double points[3 * POINTS], temperature[POINTS];
static int32_t cubes[8 * CUBES];
static const char* const surface = "{\"version\": 1, \"stream\": {}, \"pipelines\": ["
  "{\"name\": \"surface\", \"stages\": [{\"surface\": {}}, {\"stream\": {}}]}]}";

int main(int argc, char** argv)
{
  static const int corners[8] = { 0, 1, S + 1, S, S * S, S * S + 1, S * S + S + 1, S * S + S };
  for (int v = 0; v < POINTS; ++v) {
    const int at[3] = { v % S, v / S % S, v / S / S };
    for (int axis = 0; axis < 3; ++axis) points[3 * v + axis] = (double)at[axis] / N;
    temperature[v] = 300.0 + at[0];
  }
  for (int c = 0; c < CUBES; ++c)
    for (int k = 0; k < 8; ++k) cubes[8 * c + k] = c % N + c / N % N * S + c / N / N * S * S + corners[k];
  tombolo* run = NULL;
  int failed = tombolo_open(argc > 1 ? argv[1] : NULL, TOMBOLO_COMM_WORLD, &run)
    || (argc < 2 && tombolo_configure(run, surface))
    || tombolo_points_f64(run, "box", points, POINTS)
    || tombolo_cells_i32(run, "box", TOMBOLO_HEXAHEDRON, cubes, CUBES)
    || tombolo_field_f64(run, "box", "temperature", TOMBOLO_VERTEX, temperature, POINTS, 1)
    || tombolo_start(run);
  if (!failed && tombolo_link(run)) fprintf(stderr, "open %s\n", tombolo_link(run));
  const long steps = argc > 2 ? atol(argv[2]) : 1000000000;
  for (long step = 0; !failed && step < steps && !tombolo_stopped(run); ++step) {
    failed = tombolo_execute(run, (uint64_t)step, 0.1 * (double)step, 0.1);
    const double* moved = tombolo_coordinates(run);
    for (int i = 0; moved && i < 3 * POINTS; ++i) points[i] = moved[i];
    for (int v = 0; v < POINTS; ++v) temperature[v] -= 1e-3 * (temperature[v] - 300.0);
  }
  if (failed) fprintf(stderr, "%s\n", tombolo_message());
  else printf("ended at %.6f\n", temperature[POINTS - 1]);
  return tombolo_close(&run) || failed;
}
