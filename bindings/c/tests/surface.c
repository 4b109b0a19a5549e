/* A solver that moves its volume by itself: it takes the motion of the boundary and lets the inside follow. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <tombolo.h>

enum { N = 3, S = N + 1, POINTS = S * S * S, CUBES = N * N * N, INSIDE = (N - 1) * (N - 1) * (N - 1) };
static double points[3 * POINTS];
static int32_t cubes[8 * CUBES];

static void require(int holds, const char* what)
{
  if (holds) return;
  fprintf(stderr, "%s; %s\n", what, tombolo_message());
  exit(1);
}
#define REQUIRE(holds) require(holds, #holds)

int main(void)
{
  static const int corners[8] = { 0, 1, S + 1, S, S * S, S * S + 1, S * S + S + 1, S * S + S };
  for (int v = 0; v < POINTS; ++v) {
    const int at[3] = { v % S, v / S % S, v / S / S };
    for (int axis = 0; axis < 3; ++axis) points[3 * v + axis] = (double)at[axis] / N;
  }
  for (int c = 0; c < CUBES; ++c)
    for (int k = 0; k < 8; ++k) cubes[8 * c + k] = c % N + c / N % N * S + c / N / N * S * S + corners[k];

  tombolo* run = NULL;
  REQUIRE(!tombolo_open(NULL, TOMBOLO_COMM_WORLD, &run));
  REQUIRE(!tombolo_configure(run,
    "{\"version\": 1, \"pipelines\": [{\"name\": \"shape\", \"on\": \"order\", \"stages\": [{\"deform\": {\"method\": \"surface\"}}]}]}"));
  REQUIRE(!tombolo_orders(run,
    "[{\"id\": \"press\", \"at\": {\"cycle\": 1}, \"order\": {\"edits\": [{\"translate\": {"
    "\"region\": {\"half_space\": {\"origin\": [0, 0, 0.99], \"normal\": [0, 0, 1]}},"
    "\"fixed_region\": {\"half_space\": {\"origin\": [0, 0, 0.01], \"normal\": [0, 0, -1]}}, \"by\": [0, 0, -0.3]}}],"
    "\"schedule\": {\"steps\": 2, \"every\": {\"steps\": 1}}}}]"));
  REQUIRE(!tombolo_points_f64(run, "box", points, POINTS));
  REQUIRE(!tombolo_cells_i32(run, "box", TOMBOLO_HEXAHEDRON, cubes, CUBES));
  int motions = 0;
  for (uint64_t cycle = 0; cycle < 5; ++cycle) {
    REQUIRE(!tombolo_execute(run, cycle, 0.5 * (double)cycle, 0.5));
    const size_t count = tombolo_surface_count(run);
    const uint32_t* vertices = tombolo_surface_vertices(run);
    const double *to = tombolo_surface_coordinates(run), *way = tombolo_surface_displacement(run);
    const double *speed = tombolo_surface_velocity(run), *all = tombolo_coordinates(run);
    unsigned shape = 7, shapes = 7;
    REQUIRE(!tombolo_motion_shape(run, &shape, &shapes));
    if (cycle == 0 || cycle > 2) {
      REQUIRE(!count && !vertices && !to && !way && !speed && !all && !tombolo_motion_order(run) && !tombolo_motion_count(run));
      REQUIRE(shape == 0 && shapes == 0);
      continue;
    }
    REQUIRE(count == POINTS - INSIDE && vertices && to && way && speed && all && tombolo_motion_count(run) == POINTS);
    REQUIRE(shape == cycle && shapes == 2 && strcmp(tombolo_motion_order(run), "press") == 0);
    char is_outside[POINTS] = { 0 };
    for (size_t i = 0; i < count; ++i) {
      REQUIRE(vertices[i] < POINTS && !is_outside[vertices[i]]);
      is_outside[vertices[i]] = 1;
      for (int axis = 0; axis < 3; ++axis) {
        const size_t at = 3 * vertices[i] + (size_t)axis;
        REQUIRE(to[3 * i + (size_t)axis] == all[at] && way[3 * i + (size_t)axis] == tombolo_displacement(run)[at]);
        REQUIRE(speed[3 * i + (size_t)axis] == way[3 * i + (size_t)axis] / 0.5);
      }
    }
    for (size_t v = 0; v < POINTS; ++v)
      if (!is_outside[v]) REQUIRE(memcmp(all + 3 * v, points + 3 * v, 3 * sizeof(double)) == 0);
    for (size_t i = 0; i < count; ++i) memcpy(points + 3 * vertices[i], to + 3 * i, 3 * sizeof(double));
    /* The inside as this solver moves it: each vertex goes by its height. */
    for (size_t v = 0; v < POINTS; ++v)
      if (!is_outside[v]) points[3 * v + 2] = (double)(v / S / S) / N * (1.0 - 0.15 * (double)cycle);
    ++motions;
  }
  REQUIRE(motions == 2);
  double top = 0.0;
  for (size_t v = 0; v < POINTS; ++v)
    if (points[3 * v + 2] > top) top = points[3 * v + 2];
  REQUIRE(top > 0.7 - 1e-9 && top < 0.7 + 1e-9);
  REQUIRE(tombolo_order_count(run) == 1);
  REQUIRE(strstr(tombolo_order(run, 0), "\"applied\"") && !strstr(tombolo_order(run, 0), "\"not_followed\":{"));
  REQUIRE(!tombolo_finalize(run));
  REQUIRE(strstr(tombolo_order(run, 0), "\"press\"") && strstr(tombolo_report(run), tombolo_order(run, 0)));
  REQUIRE(!tombolo_close(&run));
  return 0;
}
