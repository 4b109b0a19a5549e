/* A solver that gives back arrays which it has named: what is forgotten is not read any more. */
#include "box.h"

#define ALL "{\"version\": 1, \"pipelines\": [{\"name\": \"all\", \"channel\": \"box\", \"stages\": [{\"write\": {\"file\": \"forget-{cycle:1}.vtu\"}}]}]}"
#define PRESS \
  "[{\"at\": {\"cycle\": 6}, \"order\": {\"edits\": [{\"translate\": {\"features\": [\"top\"], \"fixed\": [\"bottom\"], " \
  "\"by\": [0, 0, -0.4]}}], \"schedule\": {\"steps\": 1}}}]"

static int step(tombolo* run, int cycle) { return tombolo_execute(run, (uint64_t)cycle, 0.1 * cycle, 0.1); }

static void* copy(const void* values, size_t bytes)
{
  void* made = malloc(bytes);
  if (!made) exit(2);
  memcpy(made, values, bytes);
  return made;
}

int main(void)
{
  static const double corner[12] = { 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1 };
  static const int32_t four[4] = { 0, 1, 2, 3 };
  static const unsigned char none[1] = { 0 };
  static const int64_t first[1] = { 0 };
  static double zeros[POINTS];
  rest();
  tombolo* run = NULL;
  OK(tombolo_open(NULL, TOMBOLO_COMM_WORLD, &run));
  OK(tombolo_configure(run, ALL));
  OK(tombolo_orders(run, PRESS));
  REFUSED(tombolo_forget(run, "box", NULL), "channel: found 'box'; expected one that tombolo_points has named; none has been yet");
  lend(run);
  double *estimate = copy(zeros, sizeof zeros), *places = copy(corner, sizeof corner);
  int32_t* cell = copy(four, sizeof four);
  unsigned char* ghosts = copy(none, sizeof none);
  int64_t* numbers = copy(first, sizeof first);
  OK(tombolo_field_f64(run, "box", "error_estimate", TOMBOLO_VERTEX, estimate, POINTS, 1));
  OK(tombolo_points_f64(run, "aside", places, 4));
  OK(tombolo_cells_i32(run, "aside", TOMBOLO_TETRA, cell, 1));
  OK(tombolo_ghost_cells(run, "aside", ghosts, 1));
  OK(tombolo_global_cells_i64(run, "aside", numbers, 1));
  OK(step(run, 0));

  REFUSED(tombolo_forget(run, "box", "error_estimat"),
    "channel 'box', what to forget: found 'error_estimat'; expected one that was named; did you mean 'error_estimate'?");
  OK(tombolo_forget(run, "box", "error_estimate"));
  free(estimate);
  REFUSED(tombolo_forget(run, "box", "error_estimate"), "expected one that was named; none was");
  OK(tombolo_forget(run, "aside", "ghost_cells"));
  OK(tombolo_forget(run, "aside", "global_cells"));
  free(ghosts);
  free(numbers);
  REFUSED(tombolo_forget(run, "aside", "global_cells"), "expected one that was named; none was");
  OK(step(run, 1));

  OK(tombolo_forget(run, "aside", NULL));
  free(places);
  free(cell);
  REFUSED(tombolo_forget(run, "aside", NULL), "channel: found 'aside'; expected one that tombolo_points has named: box");
  REFUSED(tombolo_point_cells(run, "aside"), "channel: found 'aside'");
  OK(step(run, 2));
  OK(tombolo_points_f64(run, "aside", corner, 4));
  REFUSED(step(run, 3), "channel 'aside': found points without cells");
  OK(tombolo_cells_i32(run, "aside", TOMBOLO_TETRA, four, 1));
  OK(step(run, 3));

  /* The channel that orders change, forgotten and named again, is the one that it was; what it has besides stays forgotten. */
  OK(tombolo_forget(run, "box", NULL));
  lend(run);
  OK(step(run, 4));
  /* No other channel takes its place. */
  OK(tombolo_forget(run, "box", NULL));
  for (int cycle = 5; cycle < 8; ++cycle) {
    OK(step(run, cycle));
    REQUIRE(!tombolo_coordinates(run));
  }
  REQUIRE(tombolo_order_count(run) == 1 && strstr(tombolo_order(run, 0), "\"rejected\""));
  REQUIRE(strstr(tombolo_order(run, 0), "the solver no longer shows the mesh that orders change") != NULL);
  OK(tombolo_finalize(run));
  REQUIRE(tombolo_forget(run, "aside", NULL) == TOMBOLO_WRONG_CALL);
  OK(tombolo_close(&run));
  return 0;
}
