/* A solver that goes on after a step was refused: nothing of it is left, neither of its mesh nor of the motion before it. And what a run
 * can be asked for besides: to let go of its shape, to carry out a journal again, to end. */
#define _POSIX_C_SOURCE 200809L
#include <pthread.h>
#include <time.h>

#include "box.h"

#define PRESS(cycle) \
  "[{\"at\": {\"cycle\": " #cycle "}, \"order\": {\"edits\": [{\"translate\": {\"features\": [\"top\"], \"fixed\": [\"bottom\"], " \
  "\"by\": [0, 0, -0.4]}}], \"schedule\": {\"steps\": 4, \"every\": {\"steps\": 1}}}}]"
#define UNDO(cycle) "[{\"at\": {\"cycle\": " #cycle "}, \"order\": {\"undo\": 1}}]"
#define QUALITY "{\"version\": 1, \"pipelines\": [{\"name\": \"health\", \"stages\": [{\"quality\": {}}]}]}"

enum { STEPS = 12 };
static double field[POINTS];

static tombolo* opened(const char* json, const char* orders)
{
  tombolo* run = NULL;
  rest();
  OK(tombolo_open(NULL, TOMBOLO_COMM_WORLD, &run));
  OK(tombolo_configure(run, json));
  if (orders) OK(tombolo_orders(run, orders));
  lend(run);
  return run;
}

static int step(tombolo* run, int cycle) { return tombolo_execute(run, (uint64_t)cycle, 0.1 * cycle, 0.1); }

static double height(void) { return points[3 * POINTS - 1]; }

static int is_near(double value, double expected) { return value > expected - 1e-9 && value < expected + 1e-9; }

/* The first order has come to this. */
static int became(tombolo* run, const char* words) { return tombolo_order(run, 0) && strstr(tombolo_order(run, 0), words); }

static void no_motion_of_a_step_that_was_refused(void)
{
  tombolo* run = opened(QUALITY, PRESS(3));
  for (int cycle = 0; cycle < STEPS; ++cycle) {
    OK(tombolo_field_f64(run, "box", "heat", TOMBOLO_VERTEX, field, POINTS, 1));
    if (cycle == 5) {
      OK(tombolo_field_f64(run, "box", "heat", TOMBOLO_VERTEX, field, POINTS - 1, 1));
      REFUSED(step(run, cycle), "heat");
      REQUIRE(!tombolo_coordinates(run) && !tombolo_displacement(run) && !tombolo_velocity(run) && !tombolo_motion_order(run));
      REQUIRE(!tombolo_surface_vertices(run) && !tombolo_motion_count(run) && !tombolo_surface_count(run));
      continue;
    }
    OK(step(run, cycle));
    follow(run);
  }
  REQUIRE(is_near(height(), N - 0.4) && became(run, "\"applied\""));
  OK(tombolo_close(&run));
}

static void a_mesh_that_is_refused_changes_nothing(void)
{
  static int32_t broken[8 * CUBES];
  tombolo* run = opened(QUALITY, PRESS(3));
  memcpy(broken, cubes, sizeof cubes);
  broken[5] = POINTS + 7;
  for (int cycle = 0; cycle < STEPS; ++cycle) {
    OK(tombolo_cells_i32(run, "box", TOMBOLO_HEXAHEDRON, cycle == 1 ? broken : cubes, CUBES));
    if (cycle == 1) REFUSED(step(run, cycle), "cell 0: vertex 132 does not exist");
    else OK(step(run, cycle));
    follow(run);
  }
  REQUIRE(is_near(height(), N - 0.4) && became(run, "\"applied\""));
  OK(tombolo_close(&run));
}

/* The solver makes another mesh, and gets it wrong at first: by itself where it lends its cells, in the copy where they are mixed; or
   another channel is wrong. */
static void a_new_mesh_passes_when_it_is_right(int way)
{
  static int32_t others[8 * CUBES], broken[8 * CUBES], sizes[CUBES], tets[4] = { 0, 1, 2, 3 };
  static unsigned char types[CUBES], tetra[1] = { TOMBOLO_TETRA };
  static const int32_t four[1] = { 4 };
  static double corner[12] = { 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1 };
  tombolo* run = opened(QUALITY, PRESS(4));
  for (int c = 0; c < CUBES; ++c) {
    memcpy(others + 8 * c, cubes + 8 * (CUBES - 1 - c), 8 * sizeof *cubes);
    types[c] = TOMBOLO_HEXAHEDRON;
    sizes[c] = 8;
  }
  memcpy(broken, others, sizeof others);
  if (way < 2) broken[5] = POINTS + 7;
  OK(tombolo_points_f64(run, "aside", corner, 4));
  for (int cycle = 0; cycle < STEPS; ++cycle) {
    const int32_t* cells = cycle == 0 ? cubes : cycle == 1 ? broken : others;
    if (way == 0) OK(tombolo_cells_i32(run, "box", TOMBOLO_HEXAHEDRON, cells, CUBES));
    else OK(tombolo_mixed_cells_i32(run, "box", types, sizes, CUBES, cells, 8 * CUBES));
    tets[3] = way == 2 && cycle == 1 ? 4 : 3;
    OK(tombolo_mixed_cells_i32(run, "aside", tetra, four, 1, tets, 4));
    if (cycle == 1) REFUSED(step(run, cycle), "does not exist");
    else OK(step(run, cycle));
    REQUIRE(!follow(run));
  }
  REQUIRE(became(run, "\"rejected\"") && became(run, "the solver has made another mesh"));
  OK(tombolo_close(&run));
}

static void a_shape_that_is_released(void)
{
  tombolo* run = opened(QUALITY, PRESS(3));
  OK(step(run, 0));
  OK(tombolo_release_shape(run, "the solver refines its mesh"));
  OK(tombolo_cells_i32(run, "box", TOMBOLO_HEXAHEDRON, cubes, CUBES - 1));
  for (int cycle = 1; cycle < 6; ++cycle) {
    OK(step(run, cycle));
    REQUIRE(!follow(run));
  }
  REQUIRE(became(run, "\"rejected\"") && became(run, "the solver refines its mesh"));
  OK(tombolo_close(&run));
}

static void orders_add_up(void)
{
  FILE* file = fopen("orders.json", "w");
  REQUIRE(file && fputs(UNDO(2), file) >= 0 && fclose(file) == 0);
  tombolo* run = opened(QUALITY, UNDO(1));
  OK(tombolo_orders_file(run, "orders.json"));
  OK(tombolo_orders(run, UNDO(3)));
  for (int cycle = 0; cycle < 5; ++cycle) OK(step(run, cycle));
  REQUIRE(tombolo_order_count(run) == 3);
  OK(tombolo_close(&run));
}

static void a_journal_is_carried_out_again(void)
{
  static double first[STEPS][3 * POINTS];
  for (int pass = 0; pass < 2; ++pass) {
    tombolo* run = opened(pass ? QUALITY : "{\"version\": 1, \"journal\": \"journal.jsonl\"}", pass ? NULL : PRESS(3));
    if (pass) OK(tombolo_replay_file(run, "journal.jsonl"));
    for (int cycle = 0; cycle < STEPS; ++cycle) {
      OK(step(run, cycle));
      follow(run);
      if (pass) REQUIRE(memcmp(first[cycle], points, sizeof points) == 0);
      memcpy(first[cycle], points, sizeof points);
    }
    REQUIRE(is_near(height(), N - 0.4));
    OK(tombolo_close(&run));
  }
  tombolo* run = opened(QUALITY, NULL);
  REFUSED(tombolo_replay_file(run, "no-such-journal.jsonl"), "no-such-journal.jsonl: No such file");
  OK(tombolo_close(&run));
}

static void* stop(void* run)
{
  const struct timespec while_it_is_paused = { 0, 300000000 };
  nanosleep(&while_it_is_paused, NULL);
  REQUIRE(!tombolo_stopped(run));
  OK(tombolo_stop(run));
  return NULL;
}

static void a_paused_run_is_ended(void)
{
  tombolo* run = opened("{\"version\": 1, \"stream\": {\"listen\": \"127.0.0.1:0\"}, \"pipelines\": [{\"name\": \"health\", "
    "\"stages\": [{\"quality\": {}}], \"when\": \"quality.min < 2\", \"then\": [{\"pause\": {}}]}]}", NULL);
  pthread_t other;
  OK(tombolo_start(run));
  REQUIRE(tombolo_link(run) && tombolo_watching_link(run) && strcmp(tombolo_link(run), tombolo_watching_link(run)) != 0);
  OK(pthread_create(&other, NULL, stop, run));
  OK(step(run, 0));
  OK(pthread_join(other, NULL));
  REQUIRE(tombolo_stopped(run));
  OK(tombolo_finalize(run));
  REQUIRE(tombolo_stop(run) == TOMBOLO_WRONG_CALL);
  OK(tombolo_close(&run));
  /* One that was asked before it began. */
  run = opened(QUALITY, NULL);
  OK(tombolo_stop(run));
  REQUIRE(!tombolo_stopped(run));
  OK(step(run, 0));
  REQUIRE(tombolo_stopped(run));
  OK(tombolo_close(&run));
}

int main(void)
{
  no_motion_of_a_step_that_was_refused();
  a_mesh_that_is_refused_changes_nothing();
  for (int way = 0; way < 3; ++way) a_new_mesh_passes_when_it_is_right(way);
  a_shape_that_is_released();
  orders_add_up();
  a_journal_is_carried_out_again();
  a_paused_run_is_ended();
  return 0;
}
