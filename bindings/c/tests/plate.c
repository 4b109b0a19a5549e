/* A solver in two dimensions: orders that would move its vertices along z, which it does not have, are rejected with the reason. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <tombolo.h>

enum { N = 4, S = N + 1, POINTS = S * S, QUADS = N * N };
static double x[POINTS], y[POINTS];
static int32_t quads[4 * QUADS];

static void require(int holds, const char* what, int line)
{
  if (holds) return;
  fprintf(stderr, "line %d: %s; %s\n", line, what, tombolo_message());
  exit(1);
}
#define REQUIRE(holds) require(holds, #holds, __LINE__)

#define TRANSLATE(cycle, by) \
  "{\"at\": {\"cycle\": " #cycle "}, \"order\": {\"edits\": [{\"translate\": {\"region\": {\"box\": {\"lower\": [-1, -1, -1], " \
  "\"upper\": [0.5, 2, 1]}}, \"by\": " by "}}], \"schedule\": {\"steps\": 1}}}"

int main(void)
{
  const void* axes[2] = { x, y };
  tombolo* run = NULL;
  for (int v = 0; v < POINTS; ++v) {
    x[v] = (double)(v % S) / N;
    y[v] = (double)(v / S) / N;
  }
  for (int q = 0; q < QUADS; ++q) {
    const int32_t low = q % N + q / N * S, corners[4] = { low, low + 1, low + S + 1, low + S };
    memcpy(quads + 4 * q, corners, sizeof corners);
  }
  REQUIRE(!tombolo_open(NULL, TOMBOLO_COMM_WORLD, &run));
  REQUIRE(!tombolo_orders(run, "[" TRANSLATE(1, "[0.1, 0, 0.3]") ", " TRANSLATE(3, "[0.1, 0, 0]") "]"));
  REQUIRE(!tombolo_points_strided(run, "plate", TOMBOLO_FLOAT64, axes, 2, POINTS, sizeof(double)));
  REQUIRE(!tombolo_cells_i32(run, "plate", TOMBOLO_QUAD, quads, QUADS));
  for (uint64_t cycle = 0; cycle < 6; ++cycle) {
    REQUIRE(!tombolo_execute(run, cycle, 0.1 * (double)cycle, 0.1));
    const double* to = tombolo_coordinates(run);
    REQUIRE(!to == (cycle != 3));
    for (int v = 0; to && v < POINTS; ++v) {
      REQUIRE(to[3 * v + 2] == 0.0);
      x[v] = to[3 * v];
      y[v] = to[3 * v + 1];
    }
  }
  REQUIRE(tombolo_order_count(run) == 2);
  REQUIRE(strstr(tombolo_order(run, 0), "\"rejected\"") && strstr(tombolo_order(run, 0), "along z, expected 0"));
  REQUIRE(strstr(tombolo_order(run, 1), "\"applied\"") != NULL);
  REQUIRE(x[0] > 0.1 - 1e-9 && x[0] < 0.1 + 1e-9);
  REQUIRE(!tombolo_close(&run));
  return 0;
}
