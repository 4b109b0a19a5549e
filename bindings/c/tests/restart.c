/* A run that is ended in the middle of an order and goes on from its checkpoint: at every step from there on its mesh is to the bit that
 * of the run that was not interrupted. */
#include "box.h"

#define ORDERS \
  "[{\"id\": \"press\", \"at\": {\"cycle\": 2}, \"order\": {\"edits\": [{\"translate\": {\"features\": [\"top\"], " \
  "\"fixed\": [\"bottom\"], \"by\": [0.1, 0, -0.7]}}], \"schedule\": {\"steps\": 3, \"every\": {\"steps\": 2}}}}, " \
  "{\"at\": {\"cycle\": 10}, \"order\": {\"undo\": 1, \"schedule\": {\"steps\": 2, \"every\": {\"steps\": 1}}}}]"

enum { STEPS = 16, LAST = 4 };
static double whole[STEPS][3 * POINTS], first[3 * POINTS];

static tombolo* opened(void)
{
  tombolo* run = NULL;
  OK(tombolo_open(NULL, TOMBOLO_COMM_WORLD, &run));
  OK(tombolo_orders(run, ORDERS));
  OK(tombolo_parameter(run, "heating", 2.0, 0.0, 10.0));
  lend(run);
  return run;
}

/* Takes a step and moves the box. */
static void step(tombolo* run, int cycle)
{
  OK(tombolo_execute(run, (uint64_t)cycle, 0.25 * cycle, 0.25));
  follow(run);
}

int main(void)
{
  rest();
  memcpy(first, points, sizeof points);
  tombolo* run = opened();
  for (int cycle = 0; cycle < STEPS; ++cycle) {
    step(run, cycle);
    memcpy(whole[cycle], points, sizeof points);
  }
  OK(tombolo_close(&run));
  REQUIRE(memcmp(whole[1], first, sizeof first) == 0 && memcmp(whole[9], first, sizeof first) != 0);
  REQUIRE(memcmp(whole[STEPS - 1], first, sizeof first) == 0);

  rest();
  run = opened();
  REQUIRE(tombolo_checkpoint(run, "run.state") == TOMBOLO_WRONG_CALL && strstr(tombolo_message(), "called before the run began"));
  for (int cycle = 0; cycle <= LAST; ++cycle) step(run, cycle);
  unsigned shape = 0, shapes = 0;
  OK(tombolo_motion_shape(run, &shape, &shapes));
  REQUIRE(shape > 0 && shape < shapes);
  OK(tombolo_checkpoint(run, "run.state"));
  REQUIRE(tombolo_restart(run, "run.state") == TOMBOLO_WRONG_CALL);
  OK(tombolo_close(&run));
  REQUIRE(memcmp(points, whole[LAST], sizeof points) == 0);

  run = opened();
  OK(tombolo_restart(run, "run.state"));
  for (int cycle = LAST + 1; cycle < STEPS; ++cycle) {
    step(run, cycle);
    REQUIRE(memcmp(points, whole[cycle], sizeof points) == 0);
  }
  REQUIRE(tombolo_order_count(run) == 2 && strstr(tombolo_order(run, 0), "\"press\""));
  OK(tombolo_close(&run));

  run = opened();
  OK(tombolo_restart(run, "no-such.state"));
  REQUIRE(tombolo_start(run) == TOMBOLO_FAILED && strstr(tombolo_message(), "no-such.state"));
  OK(tombolo_close(&run));
  /* With another mesh: an error that says what is different. */
  run = opened();
  OK(tombolo_restart(run, "run.state"));
  for (int k = 0; k < 8; ++k) {
    const int32_t vertex = cubes[k];
    cubes[k] = cubes[8 + k];
    cubes[8 + k] = vertex;
  }
  REFUSED(tombolo_execute(run, LAST + 1, 0.25 * (LAST + 1), 0.25), "its cells have other vertices, or stand in another order");
  OK(tombolo_close(&run));
  return 0;
}
