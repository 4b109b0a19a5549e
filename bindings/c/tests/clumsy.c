/* A caller of tombolo.h who does everything wrong: each mistake has a status and a message, and nothing else happens. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <tombolo.h>

static int mistakes, wrong;

static void expect(int line, int status, int expected, const char* words)
{
  ++mistakes;
  if (status == expected && (expected == TOMBOLO_OK || strstr(tombolo_message(), words))) return;
  ++wrong;
  fprintf(stderr, "line %d: status %d, '%s'\n  expected %d, '%s'\n", line, status, tombolo_message(), expected, words);
}
#define OK(call) expect(__LINE__, call, TOMBOLO_OK, "")
#define INVALID(call, words) expect(__LINE__, call, TOMBOLO_INVALID, words)
#define WRONG(call, words) expect(__LINE__, call, TOMBOLO_WRONG_CALL, words)
/* Of a function that answers with something else than a status: what it answers where it is wrong. */
#define NONE(call, words) expect(__LINE__, (call) ? -1 : TOMBOLO_INVALID, TOMBOLO_INVALID, words)

/* Two tetrahedra on five points. */
static double points[15] = { 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1, 1, 1, 1 };
static int32_t tets[8] = { 0, 1, 2, 3, 1, 4, 2, 3 };
static int32_t triangles[18] = { 0, 1, 2, 0, 1, 3, 0, 2, 3, 1, 2, 4, 1, 3, 4, 2, 3, 4 };
static int32_t features[6] = { 1, 1, 1, 2, 2, 2 };
static double warm[5] = { 1, 2, 3, 4, 5 };
static int64_t numbers[5] = { 0, 1, 2, 3, 4 };
static const void* axes[3] = { points, points + 1, points + 2 };

/* A run whose mesh is looked at, with all that is right. */
static tombolo* good(void)
{
  tombolo* run = NULL;
  OK(tombolo_open(NULL, TOMBOLO_COMM_WORLD, &run));
  OK(tombolo_configure(run, "{\"version\": 1, \"pipelines\": [{\"name\": \"health\", \"stages\": [{\"quality\": {}}]}]}"));
  OK(tombolo_orders(run, "[{\"at\": {\"cycle\": 90}, \"order\": {\"undo\": 1}}]"));
  OK(tombolo_points_f64(run, "solid", points, 5));
  OK(tombolo_cells_i32(run, "solid", TOMBOLO_TETRA, tets, 2));
  OK(tombolo_faces_i32(run, "solid", TOMBOLO_TRIANGLE, triangles, features, 6));
  OK(tombolo_feature(run, "solid", 1, "low"));
  OK(tombolo_field_f64(run, "solid", "warm", TOMBOLO_VERTEX, warm, 5, 1));
  return run;
}
/* One mistake in a run that is right but for it, and its error at tombolo_execute; then the mistake is mended. */
#define AT_EXECUTE(mistake, words, mended) \
  do { \
    tombolo* run = good(); \
    OK(mistake); \
    INVALID(tombolo_execute(run, 0, 0.0, 0.1), words); \
    OK(mended); \
    OK(tombolo_execute(run, 0, 0.0, 0.1)); \
    OK(tombolo_close(&run)); \
  } while (0)
/* One mistake that is an error at once. */
#define AT_ONCE(status, mistake, words) \
  do { \
    tombolo* run = good(); \
    expect(__LINE__, mistake, status, words); \
    OK(tombolo_execute(run, 0, 0.0, 0.1)); \
    expect(__LINE__, mistake, status, words); \
    OK(tombolo_close(&run)); \
  } while (0)

/* Every function, of a run that is none. */
static void without_a_run(tombolo* run, const char* words)
{
  unsigned shape, shapes;
  double value = 7.0;
  WRONG(tombolo_configure(run, "{}"), words);
  WRONG(tombolo_orders(run, "[]"), words);
  WRONG(tombolo_replay_file(run, "journal.jsonl"), words);
  WRONG(tombolo_output(run, "."), words);
  WRONG(tombolo_parameter(run, "p", 0.0, 0.0, 1.0), words);
  WRONG(tombolo_start(run), words);
  WRONG(tombolo_points_f32(run, "solid", NULL, 0), words);
  WRONG(tombolo_points_f64(run, "solid", points, 5), words);
  WRONG(tombolo_points_strided(run, "solid", TOMBOLO_FLOAT64, axes, 3, 5, 24), words);
  WRONG(tombolo_cells_i32(run, "solid", TOMBOLO_TETRA, tets, 2), words);
  WRONG(tombolo_cells_i64(run, "solid", TOMBOLO_TETRA, NULL, 0), words);
  WRONG(tombolo_mixed_cells_i32(run, "solid", NULL, NULL, 0, NULL, 0), words);
  WRONG(tombolo_mixed_cells_i64(run, "solid", NULL, NULL, 0, NULL, 0), words);
  WRONG(tombolo_point_cells(run, "solid"), words);
  WRONG(tombolo_ghost_cells(run, "solid", NULL, 0), words);
  WRONG(tombolo_faces_i32(run, "solid", TOMBOLO_TRIANGLE, triangles, features, 6), words);
  WRONG(tombolo_faces_i64(run, "solid", TOMBOLO_TRIANGLE, NULL, NULL, 0), words);
  WRONG(tombolo_feature(run, "solid", 1, "low"), words);
  WRONG(tombolo_global_vertices_i32(run, "solid", NULL, 0), words);
  WRONG(tombolo_global_vertices_i64(run, "solid", NULL, 0), words);
  WRONG(tombolo_global_cells_i32(run, "solid", NULL, 0), words);
  WRONG(tombolo_global_cells_i64(run, "solid", NULL, 0), words);
  WRONG(tombolo_field_f32(run, "solid", "f", TOMBOLO_VERTEX, NULL, 0, 1), words);
  WRONG(tombolo_field_f64(run, "solid", "f", TOMBOLO_VERTEX, warm, 5, 1), words);
  WRONG(tombolo_field_i32(run, "solid", "f", TOMBOLO_VERTEX, NULL, 0, 1), words);
  WRONG(tombolo_field_i64(run, "solid", "f", TOMBOLO_VERTEX, NULL, 0, 1), words);
  WRONG(tombolo_field_u8(run, "solid", "f", TOMBOLO_VERTEX, NULL, 0, 1), words);
  WRONG(tombolo_field_strided(run, "solid", "f", TOMBOLO_VERTEX, TOMBOLO_FLOAT64, axes, 3, 5, 24), words);
  WRONG(tombolo_forget(run, "solid", "f"), words);
  WRONG(tombolo_forget(run, "solid", NULL), words);
  WRONG(tombolo_execute(run, 0, 0.0, 0.1), words);
  WRONG(tombolo_motion_shape(run, &shape, &shapes), words);
  WRONG(tombolo_parameter_value(run, "p", &value), words);
  WRONG(tombolo_finalize(run), words);
  WRONG(tombolo_release_shape(run, "another mesh"), words);
  WRONG(tombolo_stop(run), words);
  NONE(tombolo_link(run) != NULL, words);
  NONE(tombolo_watching_link(run) != NULL, words);
  NONE(tombolo_coordinates(run) != NULL, words);
  NONE(tombolo_displacement(run) != NULL, words);
  NONE(tombolo_velocity(run) != NULL, words);
  NONE(tombolo_motion_count(run) != 0, words);
  NONE(tombolo_surface_count(run) != 0, words);
  NONE(tombolo_surface_vertices(run) != NULL, words);
  NONE(tombolo_surface_coordinates(run) != NULL, words);
  NONE(tombolo_surface_displacement(run) != NULL, words);
  NONE(tombolo_surface_velocity(run) != NULL, words);
  NONE(tombolo_motion_order(run) != NULL, words);
  NONE(!tombolo_stopped(run), words);
  NONE(tombolo_order_count(run) != 0, words);
  NONE(tombolo_order(run, 0) != NULL, words);
  NONE(tombolo_report(run) != NULL, words);
}

static void pointers_and_times(void)
{
  without_a_run(NULL, "the run is a null pointer");
  tombolo* run = good();
  tombolo* copy = run;
  WRONG(tombolo_close(NULL), "the address of the run is a null pointer");
  OK(tombolo_close(&run));
  NONE(run != NULL, "");
  OK(tombolo_close(&run));
  without_a_run(copy, "the run is not open: it was closed, or never opened");
  WRONG(tombolo_close(&copy), "the run is not open");
  without_a_run((tombolo*)points, "the run is not open");

  WRONG(tombolo_open(NULL, TOMBOLO_COMM_WORLD, NULL), "the address of the run is a null pointer");
  run = (tombolo*)points;
  INVALID(tombolo_open("no-such-file.json", TOMBOLO_COMM_WORLD, &run), "no-such-file.json: No such file");
  NONE(run != NULL, "");
  run = good();
  WRONG(tombolo_configure(run, NULL), "json is a null pointer");
  INVALID(tombolo_configure(run, "{\"version\": 1, \"pipelinez\": []}"), "pipelines");
  INVALID(tombolo_configure(run, "\xff"), "json: found bytes that are not UTF-8");
  WRONG(tombolo_orders_file(run, NULL), "file is a null pointer");
  INVALID(tombolo_orders_file(run, "no-such-file.json"), "no-such-file.json: No such file");
  INVALID(tombolo_orders(run, "[{\"at\": {}}]"), "orders");
  WRONG(tombolo_replay_file(run, NULL), "file is a null pointer");
  INVALID(tombolo_replay_file(run, "no-such-file.jsonl"), "no-such-file.jsonl: No such file");
  WRONG(tombolo_output(run, NULL), "directory is a null pointer");
  WRONG(tombolo_parameter(run, NULL, 0.0, 0.0, 1.0), "the parameter's name is a null pointer");
  INVALID(tombolo_parameter(run, "", 0.0, 0.0, 1.0), "the parameter's name: found \"\"");
  NONE(tombolo_report(run) != NULL, "called before tombolo_finalize");
  NONE(tombolo_coordinates(run) != NULL, "called before the run began");
  NONE(tombolo_link(run) != NULL, "called before the run began");
  NONE(tombolo_watching_link(run) != NULL, "called before the run began");
  WRONG(tombolo_release_shape(run, "another mesh"), "called before the run began");
  OK(tombolo_parameter(run, "heating", 2.0, 0.0, 10.0));
  WRONG(tombolo_condition(run, NULL, TOMBOLO_WALL), "the feature's name is a null pointer");
  INVALID(tombolo_condition(run, "z-min", 9), "condition: found 9; expected TOMBOLO_INFLOW, TOMBOLO_OUTFLOW or TOMBOLO_WALL");
  OK(tombolo_condition(run, "z-min", TOMBOLO_INFLOW));
  OK(tombolo_start(run));
  WRONG(tombolo_start(run), "called twice");
  WRONG(tombolo_configure(run, "{\"version\": 1}"), "called after the run began");
  WRONG(tombolo_parameter(run, "late", 0.0, 0.0, 1.0), "called after the run began");
  WRONG(tombolo_condition(run, "z-min", TOMBOLO_INFLOW), "called after the run began");
  WRONG(tombolo_replay_file(run, "journal.jsonl"), "called after the run began");
  WRONG(tombolo_release_shape(run, NULL), "the reason is a null pointer");
  INVALID(tombolo_release_shape(run, ""), "the reason: found \"\"");
  double value = 7.0;
  INVALID(tombolo_parameter_value(run, "heatng", &value), "parameter: found 'heatng'; expected one that tombolo_parameter declared; did you mean 'heating'?");
  WRONG(tombolo_parameter_value(run, "heating", NULL), "value is a null pointer");
  WRONG(tombolo_parameter_value(run, NULL, &value), "the parameter's name is a null pointer");
  OK(tombolo_parameter_value(run, "heating", &value));
  NONE(value != 2.0, "");
  INVALID(tombolo_execute(run, 0, NAN, 0.1), "time is NaN");
  INVALID(tombolo_execute(run, 0, 0.0, -1.0), "time_step is -1");
  OK(tombolo_execute(run, 0, 0.0, 0.1));
  unsigned shape;
  WRONG(tombolo_motion_shape(run, &shape, NULL), "null pointer");
  NONE(tombolo_order(run, 1000) != NULL, "order: found 1000; expected no index, as there are no orders");
  OK(tombolo_finalize(run));
  WRONG(tombolo_finalize(run), "called after tombolo_finalize");
  WRONG(tombolo_execute(run, 1, 0.1, 0.1), "called after tombolo_finalize");
  WRONG(tombolo_points_f64(run, "solid", points, 5), "called after tombolo_finalize");
  WRONG(tombolo_field_f64(run, "solid", "warm", TOMBOLO_VERTEX, warm, 5, 1), "called after tombolo_finalize");
  NONE(tombolo_coordinates(run) != NULL, "called after tombolo_finalize");
  NONE(!tombolo_stopped(run), "");
  NONE(tombolo_report(run) == NULL, "");
  OK(tombolo_close(&run));

  OK(tombolo_open(NULL, TOMBOLO_COMM_WORLD, &run));
  INVALID(tombolo_execute(run, 0, 0.0, 0.1), "cycle 0: no channel was given");
  OK(tombolo_parameter(run, "twice", 1.0, 0.0, 1.0) ? TOMBOLO_OK : TOMBOLO_WRONG_CALL);
  OK(tombolo_close(&run));
  OK(tombolo_open(NULL, TOMBOLO_COMM_WORLD, &run));
  OK(tombolo_parameter(run, "same", 1.0, 0.0, 1.0));
  INVALID(tombolo_parameter(run, "same", 1.0, 0.0, 1.0), "parameter 'same' is declared twice");
  INVALID(tombolo_parameter(run, "p", 50.0, 0.0, 40.0), "parameter 'p' cannot be 50; it must be a number from 0 to 40");
  INVALID(tombolo_parameter(run, "p", NAN, 0.0, 40.0), "parameter 'p' cannot be NaN");
  INVALID(tombolo_parameter(run, "p", 5.0, 40.0, 0.0), "parameter 'p' has the bounds 40 and 0");
  INVALID(tombolo_parameter(run, "p", 5.0, 0.0, INFINITY), "parameter 'p' has the bounds 0 and");
  /* What was refused was not kept: the run begins, and has the parameters that were declared rightly. */
  OK(tombolo_parameter(run, "p", 5.0, 0.0, 40.0));
  OK(tombolo_start(run));
  OK(tombolo_parameter_value(run, "p", &value));
  NONE(value != 5.0, "");
  OK(tombolo_close(&run));
}

static void arguments(void)
{
  AT_ONCE(TOMBOLO_WRONG_CALL, tombolo_points_f64(run, NULL, points, 5), "the channel's name is a null pointer");
  AT_ONCE(TOMBOLO_INVALID, tombolo_points_f64(run, "", points, 5), "the channel's name: found \"\"");
  AT_ONCE(TOMBOLO_INVALID, tombolo_points_f64(run, "a\nb", points, 5), "on one line");
  AT_ONCE(TOMBOLO_INVALID, tombolo_points_f64(run, "solid", NULL, 5), "channel 'solid', points: found a null pointer; expected the address of 5 values");
  AT_ONCE(TOMBOLO_INVALID, tombolo_points_f64(run, "solid", points, (size_t)-5), "expected as many as memory can hold");
  AT_ONCE(TOMBOLO_INVALID, tombolo_points_strided(run, "solid", TOMBOLO_INT32, axes, 3, 5, 24), "channel 'solid', points: found the type int32; expected float32 or float64");
  AT_ONCE(TOMBOLO_INVALID, tombolo_points_strided(run, "solid", (enum tombolo_type)99, axes, 3, 5, 24), "found the type 99");
  AT_ONCE(TOMBOLO_INVALID, tombolo_points_strided(run, "solid", TOMBOLO_FLOAT64, axes, 1, 5, 24), "found 1 components; expected 2 to 3");
  AT_ONCE(TOMBOLO_INVALID, tombolo_points_strided(run, "solid", TOMBOLO_FLOAT64, axes, -3, 5, 24), "found -3 components");
  AT_ONCE(TOMBOLO_INVALID, tombolo_points_strided(run, "solid", TOMBOLO_FLOAT64, NULL, 3, 5, 24), "the addresses of 3 components");
  AT_ONCE(TOMBOLO_INVALID, tombolo_points_strided(run, "solid", TOMBOLO_FLOAT64, axes, 3, 5, 4), "found a stride of 4 bytes; expected 8 or more");
  AT_ONCE(TOMBOLO_INVALID, tombolo_points_strided(run, "solid", TOMBOLO_FLOAT64, axes, 3, 5, -24), "found a stride of -24 bytes");
  AT_ONCE(TOMBOLO_INVALID, tombolo_cells_i32(run, "solit", TOMBOLO_TETRA, tets, 2), "channel: found 'solit'; expected one that tombolo_points has named; did you mean 'solid'?");
  AT_ONCE(TOMBOLO_INVALID, tombolo_field_f64(run, "fluid-before-its-mesh", "f", TOMBOLO_VERTEX, warm, 5, 1), "expected one that tombolo_points has named: solid");
  AT_ONCE(TOMBOLO_INVALID, tombolo_cells_i32(run, "solid", (enum tombolo_cell_type)99, tets, 2), "found the cell type 99; expected one of enum tombolo_cell_type");
  AT_ONCE(TOMBOLO_INVALID, tombolo_cells_i32(run, "solid", (enum tombolo_cell_type)-1, tets, 2), "found the cell type -1");
  AT_ONCE(TOMBOLO_INVALID, tombolo_cells_i32(run, "solid", TOMBOLO_POLYGON, tets, 2), "found the cell type 7; expected a type whose cells have equally many vertices; polygons are cells of tombolo_mixed_cells");
  AT_ONCE(TOMBOLO_INVALID, tombolo_cells_i32(run, "solid", TOMBOLO_TETRA, NULL, 2), "the address of 8 values");
  AT_ONCE(TOMBOLO_INVALID, tombolo_cells_i32(run, "solid", TOMBOLO_TETRA, tets, (size_t)-2), "as many as memory can hold");
  AT_ONCE(TOMBOLO_INVALID, tombolo_cells_i64(run, "solid", TOMBOLO_TETRA, numbers, SIZE_MAX / 4), "as many as memory can hold");
  AT_ONCE(TOMBOLO_INVALID, tombolo_faces_i32(run, "solid", TOMBOLO_TETRA, tets, features, 2), "found tetra; expected TOMBOLO_TRIANGLE or TOMBOLO_QUAD");
  AT_ONCE(TOMBOLO_INVALID, tombolo_faces_i32(run, "solid", TOMBOLO_TRIANGLE, triangles, NULL, 6), "faces, features: found a null pointer");
  AT_ONCE(TOMBOLO_INVALID, tombolo_feature(run, "solid", 1, "high"), "channel 'solid', feature 1: found the name 'high'; expected 'low', as it was named before");
  AT_ONCE(TOMBOLO_WRONG_CALL, tombolo_feature(run, "solid", 1, NULL), "the feature's name is a null pointer");
  AT_ONCE(TOMBOLO_INVALID, tombolo_field_f64(run, "solid", "f", (enum tombolo_association)7, warm, 5, 1), "field 'f': found the association 7; expected TOMBOLO_VERTEX (0) or TOMBOLO_CELL (1)");
  AT_ONCE(TOMBOLO_INVALID, tombolo_field_f64(run, "solid", "f", TOMBOLO_VERTEX, warm, 5, 0), "found 0 components; expected 1 to 9");
  AT_ONCE(TOMBOLO_INVALID, tombolo_field_f64(run, "solid", "f", TOMBOLO_VERTEX, warm, 5, 10), "found 10 components");
  AT_ONCE(TOMBOLO_INVALID, tombolo_field_f64(run, "solid", "f", TOMBOLO_VERTEX, NULL, 5, 1), "field 'f': found a null pointer");
  AT_ONCE(TOMBOLO_INVALID, tombolo_field_f64(run, "solid", "f", TOMBOLO_VERTEX, warm, SIZE_MAX / 8, 1), "as many as memory can hold");
  AT_ONCE(TOMBOLO_WRONG_CALL, tombolo_field_f64(run, "solid", NULL, TOMBOLO_VERTEX, warm, 5, 1), "the field's name is a null pointer");
  AT_ONCE(TOMBOLO_INVALID, tombolo_field_strided(run, "solid", "f", TOMBOLO_VERTEX, TOMBOLO_FLOAT64, axes, 3, 5, 0), "found a stride of 0 bytes");
  AT_ONCE(TOMBOLO_INVALID, tombolo_ghost_cells(run, "solid", NULL, 2), "ghost cells: found a null pointer");
  AT_ONCE(TOMBOLO_INVALID, tombolo_forget(run, "solid", "warn"), "channel 'solid', what to forget: found 'warn'; expected one that was named; did you mean 'warm'?");
  AT_ONCE(TOMBOLO_INVALID, tombolo_forget(run, "solit", NULL), "channel: found 'solit'; expected one that tombolo_points has named; did you mean 'solid'?");
  AT_ONCE(TOMBOLO_WRONG_CALL, tombolo_forget(run, NULL, NULL), "the channel's name is a null pointer");
  AT_ONCE(TOMBOLO_INVALID, tombolo_log((enum tombolo_level)9, NULL, NULL), "log: found the level 9");

  tombolo* run = good();
  INVALID(tombolo_cells_i32(run, "solid", TOMBOLO_QUAD, tets, 2), "expected cells of one type, or of several by tombolo_mixed_cells");
  OK(tombolo_close(&run));
}

static void arrays(void)
{
  static int32_t beyond[8] = { 0, 1, 2, 3, 1, 5, 2, 3 }, negative[8] = { 0, 1, 2, 3, 1, -4, 2, 3 };
  static double infinite[15] = { 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1, 1, INFINITY, 1 };
  static int32_t nowhere[18] = { 0, 1, 2, 0, 1, 3, 0, 2, 3, 1, 2, 4, 1, 3, 4, 0, 1, 4 }, lid[6] = { 1, 1, 7, 2, 2, 2 };
  static unsigned char ghosts[2] = { 0, 0 }, unknown[2] = { TOMBOLO_TETRA, 21 }, types[2] = { TOMBOLO_TETRA, TOMBOLO_TETRA };
  static unsigned char polygon[1] = { TOMBOLO_POLYGON };
  static int32_t sizes[2] = { 4, 4 }, longer[12] = { 0, 1, 2, 3, 1, 4, 2, 3, 0, 1, 2, 3 }, five[1] = { 5 }, corners[5] = { 0, 1, 4, 2, 3 };
  static int64_t below[5] = { 0, 1, 2, 3, -4 };
  void* const nowhere_in_memory = (void*)4096;

  AT_EXECUTE(tombolo_points_f64(run, "sold", points, 5), "channel 'sold': found points without cells; expected tombolo_cells", tombolo_point_cells(run, "sold"));
  AT_EXECUTE(tombolo_field_f64(run, "solid", "warm", TOMBOLO_CELL, warm, 5, 1), "warm", tombolo_field_f64(run, "solid", "warm", TOMBOLO_VERTEX, warm, 5, 1));
  AT_EXECUTE(tombolo_field_f64(run, "solid", "warm", TOMBOLO_VERTEX, warm, 2, 1), "warm", tombolo_field_f64(run, "solid", "warm", TOMBOLO_VERTEX, warm, 5, 1));
  AT_EXECUTE(tombolo_field_f64(run, "solid", "warm", TOMBOLO_VERTEX, (double*)4096, 5, 1), "cannot be read", tombolo_field_f64(run, "solid", "warm", TOMBOLO_VERTEX, warm, 5, 1));
  AT_EXECUTE(tombolo_points_f64(run, "solid", points, 3), "", tombolo_points_f64(run, "solid", points, 5));
  AT_EXECUTE(tombolo_points_f64(run, "solid", infinite, 5), "inf", tombolo_points_f64(run, "solid", points, 5));
  AT_EXECUTE(tombolo_cells_i32(run, "solid", TOMBOLO_TETRA, beyond, 2), "5", tombolo_cells_i32(run, "solid", TOMBOLO_TETRA, tets, 2));
  AT_EXECUTE(tombolo_cells_i32(run, "solid", TOMBOLO_TETRA, negative, 2), "-4", tombolo_cells_i32(run, "solid", TOMBOLO_TETRA, tets, 2));
  AT_EXECUTE(tombolo_ghost_cells(run, "solid", ghosts, 1), "ghost", tombolo_ghost_cells(run, "solid", ghosts, 2));
  AT_EXECUTE(tombolo_global_vertices_i64(run, "solid", numbers, 4), "array 'global_vertices': 4 values where 5 are needed", tombolo_global_vertices_i64(run, "solid", numbers, 5));
  AT_EXECUTE(tombolo_global_cells_i64(run, "solid", numbers, 4), "array 'global_cells': 4 values where 2 are needed", tombolo_global_cells_i64(run, "solid", numbers, 2));
  AT_EXECUTE(tombolo_faces_i32(run, "solid", TOMBOLO_TRIANGLE, nowhere, features, 6), "channel 'solid': face 5 of those with features (2, vertices 0, 1, 4) is no face of any cell", tombolo_faces_i32(run, "solid", TOMBOLO_TRIANGLE, triangles, features, 6));
  AT_EXECUTE(tombolo_feature(run, "solid", 7, "lid"), "feature 'lid' has the number 7, which no face has; the faces have 1, 2", tombolo_faces_i32(run, "solid", TOMBOLO_TRIANGLE, triangles, lid, 6));

  AT_EXECUTE(tombolo_points_f64(run, "solid", nowhere_in_memory, 5), "channel 'solid', points: found 5 values whose memory at", tombolo_points_f64(run, "solid", points, 5));
  AT_EXECUTE(tombolo_ghost_cells(run, "solid", nowhere_in_memory, 2), "channel 'solid', ghost cells: found 2 values whose memory at", tombolo_ghost_cells(run, "solid", ghosts, 2));
  AT_EXECUTE(tombolo_global_vertices_i64(run, "solid", nowhere_in_memory, 5), "channel 'solid', global vertices: found 5 values whose memory at", tombolo_global_vertices_i64(run, "solid", numbers, 5));
  AT_EXECUTE(tombolo_global_cells_i64(run, "solid", nowhere_in_memory, 2), "channel 'solid', global cells: found 2 values whose memory at", tombolo_global_cells_i64(run, "solid", numbers, 2));
  AT_EXECUTE(tombolo_global_vertices_i64(run, "solid", below, 5), "channel 'solid', global vertices: found the number -4 at entry 4; expected whole numbers from 0 on", tombolo_global_vertices_i64(run, "solid", numbers, 5));
  AT_EXECUTE(tombolo_mixed_cells_i32(run, "solid", unknown, sizes, 2, tets, 8), "channel 'solid', cell types: found 21 at entry 1; expected one of enum tombolo_cell_type", tombolo_mixed_cells_i32(run, "solid", types, sizes, 2, tets, 8));
  AT_EXECUTE(tombolo_mixed_cells_i32(run, "solid", types, sizes, 2, longer, 12), "channel 'solid', cells, connectivity: found 12 entries, of which the rows have 8; expected as many as the sizes add up to", tombolo_mixed_cells_i32(run, "solid", types, sizes, 2, longer, 8));

  tombolo* run = good();
  OK(tombolo_points_f64(run, "plate", points, 5));
  OK(tombolo_mixed_cells_i32(run, "plate", polygon, five, 1, corners, 5));
  OK(tombolo_execute(run, 0, 0.0, 0.1));
  OK(tombolo_feature(run, "solid", 1, "low"));
  INVALID(tombolo_feature(run, "solid", 2, "late"), "channel 'solid', feature 2: found the name 'late' after tombolo_execute has shown the channel; expected all names before");
  OK(tombolo_close(&run));

  OK(tombolo_open(NULL, TOMBOLO_COMM_WORLD, &run));
  OK(tombolo_points_f64(run, "solid", points, 5));
  OK(tombolo_cells_i32(run, "solid", TOMBOLO_TETRA, tets, 2));
  OK(tombolo_feature(run, "solid", 1, "low"));
  INVALID(tombolo_execute(run, 0, 0.0, 0.1), "channel 'solid', feature 'low' (1): found no faces; expected tombolo_faces");
  OK(tombolo_close(&run));
}

static char told[4096];
static int tellings;

static void take(int level, const char* message, void* user_data)
{
  if (user_data != told) abort();
  WRONG(tombolo_log(TOMBOLO_LOG_OFF, NULL, NULL), "called by the function that takes the messages");
  snprintf(told, sizeof told, "%d %s", level, message);
  ++tellings;
}

static void log_of_messages(void)
{
  for (int level = TOMBOLO_LOG_OFF; level <= TOMBOLO_LOG_DEBUG; ++level) {
    tellings = 0;
    *told = 0;
    OK(tombolo_log((enum tombolo_level)level, take, told));
    tombolo* run = NULL;
    OK(tombolo_open(NULL, TOMBOLO_COMM_WORLD, &run));
    /* A configuration's mistake is none of the solver's: it is told, and the run goes on. */
    OK(tombolo_configure(run, "{\"version\": 1, \"pipelines\": [{\"name\": \"health\", \"channel\": \"fluid\", \"stages\": [{\"quality\": {}}]}]}"));
    OK(tombolo_points_f64(run, "solid", points, 5));
    OK(tombolo_cells_i32(run, "solid", TOMBOLO_TETRA, tets, 2));
    OK(tombolo_execute(run, 0, 0.0, 0.1));
    OK(tombolo_close(&run));
    const int expected = level >= TOMBOLO_LOG_WARNING;
    if ((tellings > 0) != expected || (expected && !strstr(told, "2 cycle 0, pipeline 'health'"))) {
      ++wrong;
      fprintf(stderr, "level %d: %d messages, '%s'\n", level, tellings, told);
    }
  }
  OK(tombolo_log(TOMBOLO_LOG_WARNING, NULL, NULL));
}

int main(void)
{
  if (strcmp(tombolo_version(), TOMBOLO_VERSION) != 0 || !TOMBOLO_VERSION_AT_LEAST(0, 1, 0) || TOMBOLO_VERSION_AT_LEAST(99, 0, 0)) {
    fprintf(stderr, "version %s of the library, %s of the header\n", tombolo_version(), TOMBOLO_VERSION);
    return 1;
  }
  if (!tombolo_message() || *tombolo_message()) return 1;
  pointers_and_times();
  arguments();
  arrays();
  log_of_messages();
  printf("%d mistakes\n", mistakes);
  return wrong > 0;
}
