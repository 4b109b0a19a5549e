/* Tombolo for solvers in C: watch a running simulation in a browser, and change the shape of its domain while it runs.
 *
 *   tombolo* run;
 *   tombolo_open("pipelines.json", TOMBOLO_COMM_WORLD, &run);
 *   tombolo_points_f64(run, "solid", coordinates, points);             x y z of each point
 *   tombolo_cells_i32(run, "solid", TOMBOLO_TETRA, tets, cells);       four vertices of each cell, counted from 0
 *   tombolo_field_f64(run, "solid", "temperature", TOMBOLO_VERTEX, temperature, points, 1);
 *   for each step:
 *     tombolo_execute(run, cycle, time, time_step);
 *     const double* moved = tombolo_coordinates(run);                  NULL: the mesh stays
 *   tombolo_close(&run);
 *
 * Errors. A function that answers with an int answers TOMBOLO_OK, which is 0, or another status; one that answers with a pointer
 * answers NULL. tombolo_message() then says what is wrong, what was found and what was expected. Nothing was changed, and the solver
 * may go on; the mesh stays over a step that tombolo_execute has refused.
 *
 * Arrays are lent, not copied. They are named once, and again where an array has moved in memory; those that were named last are
 * read inside tombolo_execute and at no other time, until tombolo_forget. Each count is one of points, cells or faces, never of numbers or bytes. Counts
 * that do not fit together are an error of tombolo_execute.
 *
 * Texts that are answered belong to the run and are never cut; each function says how long they are valid.
 *
 * Ranks. On several ranks of MPI all call tombolo_open, tombolo_restart, tombolo_replay_file, tombolo_start, tombolo_execute,
 * tombolo_checkpoint, tombolo_release_shape, tombolo_finalize and tombolo_close, for the same cycle and with the same files; an error of
 * one rank is that of all. What one rank alone gives wrongly to tombolo_open, tombolo_checkpoint or
 * tombolo_release_shape holds none up: nothing is done on any.
 *
 * Threads. One thread at a time uses a run; another is answered with TOMBOLO_WRONG_CALL, and so is whoever uses a run that was closed.
 * Any thread may call tombolo_stop and tombolo_stopped, also while another is in a call. */
#ifndef TOMBOLO_H
#define TOMBOLO_H

#include <stddef.h>
#include <stdint.h>

/* The version of this header; that of the library is tombolo_version(). */
#define TOMBOLO_VERSION_MAJOR 0
#define TOMBOLO_VERSION_MINOR 1
#define TOMBOLO_VERSION_PATCH 0
#define TOMBOLO_VERSION "0.1.0"
/* Whether this header is that of a version or a newer one. */
#define TOMBOLO_VERSION_AT_LEAST(major, minor, patch) \
  (TOMBOLO_VERSION_MAJOR * 1000000 + TOMBOLO_VERSION_MINOR * 1000 + TOMBOLO_VERSION_PATCH >= \
    (major) * 1000000 + (minor) * 1000 + (patch))

#ifdef __cplusplus
extern "C" {
#endif

/* A run: opened, begun, or ended. */
typedef struct tombolo tombolo;

enum tombolo_status
{
  TOMBOLO_OK = 0,
  TOMBOLO_WRONG_CALL = 1,   /* at the wrong time, of a run that is not open, or with a null pointer */
  TOMBOLO_INVALID = 100,    /* an argument, an array or a file that makes no sense */
  TOMBOLO_FAILED = 102      /* the run could not begin, or a file not be written */
};

/* Types of numbers. */
enum tombolo_type
{
  TOMBOLO_INT8 = 3,
  TOMBOLO_INT16 = 4,
  TOMBOLO_INT32 = 5,
  TOMBOLO_INT64 = 6,
  TOMBOLO_UINT8 = 7,
  TOMBOLO_UINT16 = 8,
  TOMBOLO_UINT32 = 9,
  TOMBOLO_UINT64 = 10,
  TOMBOLO_FLOAT32 = 11,
  TOMBOLO_FLOAT64 = 12
};

/* What flow does at a feature of the mesh. */
enum tombolo_boundary
{
  TOMBOLO_INFLOW = 1,
  TOMBOLO_OUTFLOW = 2,
  TOMBOLO_WALL = 3
};

/* What a field has one value for. */
enum tombolo_association
{
  TOMBOLO_VERTEX = 0,
  TOMBOLO_CELL = 1
};

/* Types of cells: VTK's numbers, and VTK's order of their vertices. Polygons are cells of tombolo_mixed_cells alone. */
enum tombolo_cell_type
{
  TOMBOLO_POINT = 1,
  TOMBOLO_LINE = 3,
  TOMBOLO_TRIANGLE = 5,
  TOMBOLO_POLYGON = 7,
  TOMBOLO_QUAD = 9,
  TOMBOLO_TETRA = 10,
  TOMBOLO_HEXAHEDRON = 12,
  TOMBOLO_WEDGE = 13,
  TOMBOLO_PYRAMID = 14
};

/* How much is told: what went wrong; from TOMBOLO_LOG_INFO on also each step of an order, what was commanded and who watches. */
enum tombolo_level
{
  TOMBOLO_LOG_OFF = 0,
  TOMBOLO_LOG_ERROR = 1,
  TOMBOLO_LOG_WARNING = 2,
  TOMBOLO_LOG_INFO = 3,
  TOMBOLO_LOG_DEBUG = 4
};

/* The library's version, such as "0.1.0"; valid always. */
const char* tombolo_version(void);
/* What the last call of this thread that went wrong says; never NULL, valid until this thread's next call that goes wrong. */
const char* tombolo_message(void);

/* Takes what is told besides the errors of calls: `level` is one of enum tombolo_level, the message is valid during the call. It is
 * called by any thread, one at a time, and must not call tombolo_log. */
typedef void (*tombolo_log_function)(int level, const char* message, void* user_data);
/* Hands messages up to a level to a function, for the whole process; NULL: to standard error. Without this call warnings and errors go
 * to standard error. Once it returns the function before is not called any more. */
int tombolo_log(enum tombolo_level level, tombolo_log_function function, void* user_data);

/* ---- Opening. */

/* All ranks where MPI runs, else this process. */
#define TOMBOLO_COMM_WORLD (-1)

/* Opens a run: of a file with the pipelines and the server, or of NULL where tombolo_configure says it or nothing is watched; on the
 * ranks of a communicator, by its handle in Fortran (MPI_Comm_c2f). `*run` is NULL where it is not TOMBOLO_OK. */
int tombolo_open(const char* file, int communicator, tombolo** run);
/* The pipelines and the server, as JSON; in place of those of a file. */
int tombolo_configure(tombolo* run, const char* json);
/* Orders that are carried out at their cycle, as JSON, or a file of them or a journal. Each call adds to those before. */
int tombolo_orders(tombolo* run, const char* json);
int tombolo_orders_file(tombolo* run, const char* file);
/* Carries out the newest run of a journal again, in place of orders: with the same solver and configuration the same shapes come at the
 * same cycles, to the bit. What pipelines order meanwhile is passed over, because the journal holds it. */
int tombolo_replay_file(tombolo* run, const char* file);
/* The directory of files that pipelines write; else the current one. */
int tombolo_output(tombolo* run, const char* directory);
/* A number that can be steered, within its bounds, which are finite. One that makes no sense, or whose name was declared before, is
 * refused here and not kept. */
int tombolo_parameter(tombolo* run, const char* name, double value, double minimum, double maximum);
/* What a feature of the mesh is to the flow: TOMBOLO_INFLOW, TOMBOLO_OUTFLOW or TOMBOLO_WALL. Viewers hold inflow and outflow still until
 * somebody wants otherwise. */
int tombolo_condition(tombolo* run, const char* feature, int condition);
/* Goes on from the state that tombolo_checkpoint has saved, with the same mesh on as many ranks: the next tombolo_execute is the one
 * that would have come next. Before the run begins, on all ranks. */
int tombolo_restart(tombolo* run, const char* file);
/* Begins; the first tombolo_execute does so where this was not called. */
int tombolo_start(tombolo* run);
/* The link that a browser opens, once the run has begun; NULL without a server. Whoever has it can drive. Valid until tombolo_close. */
const char* tombolo_link(tombolo* run);
/* The link of those who watch and can never drive; as tombolo_link. */
const char* tombolo_watching_link(tombolo* run);

/* ---- The mesh of a channel. Its points come first. The first channel that is named is the one that orders change, or the one that the
 * configuration's pipeline with "on": "order" has as its channel; its vertices and cells stay the same. */

/* Points: x y z of each. */
int tombolo_points_f32(tombolo* run, const char* channel, const float* points, size_t count);
int tombolo_points_f64(tombolo* run, const char* channel, const double* points, size_t count);
/* Points that lie otherwise: the addresses of the first x, y and, where the dimension is 3, z, and the bytes from one point to the next.
 * Where the dimension is 2 on all ranks that have points, orders that would move a vertex along z are rejected. */
int tombolo_points_strided(tombolo* run, const char* channel, enum tombolo_type type, const void* const* axes, int dimension,
  size_t count, ptrdiff_t stride);

/* Cells of one type: the vertices of each, counted from 0. */
int tombolo_cells_i32(
  tombolo* run, const char* channel, enum tombolo_cell_type type, const int32_t* connectivity, size_t cells);
int tombolo_cells_i64(
  tombolo* run, const char* channel, enum tombolo_cell_type type, const int64_t* connectivity, size_t cells);
/* Cells each of its own type: the type and the number of vertices of each, and `length` vertices in all, which the numbers add up to. */
int tombolo_mixed_cells_i32(tombolo* run, const char* channel, const unsigned char* types, const int32_t* sizes, size_t cells,
  const int32_t* connectivity, size_t length);
int tombolo_mixed_cells_i64(tombolo* run, const char* channel, const unsigned char* types, const int64_t* sizes, size_t cells,
  const int64_t* connectivity, size_t length);
/* Points alone: each is a cell. */
int tombolo_point_cells(tombolo* run, const char* channel);
/* For each cell the bits of VTK's vtkGhostType: 1 where it is a copy of another rank's, 32 where it is hidden, 8 where finer cells lie
   over it, else 0. */
int tombolo_ghost_cells(tombolo* run, const char* channel, const unsigned char* ghosts, size_t cells);

/* Faces of the boundary, each with the number of the feature that it belongs to; triangles and quads by a call each. Without them
 * features are found at sharp edges. */
int tombolo_faces_i32(tombolo* run, const char* channel, enum tombolo_cell_type type, const int32_t* connectivity,
  const int32_t* features, size_t faces);
int tombolo_faces_i64(tombolo* run, const char* channel, enum tombolo_cell_type type, const int64_t* connectivity,
  const int64_t* features, size_t faces);
/* The name of a feature, which it keeps, before the channel is shown. Several numbers with one name are one feature. */
int tombolo_feature(tombolo* run, const char* channel, int64_t number, const char* name);

/* Numbers in the whole mesh, on several ranks. */
int tombolo_global_vertices_i32(tombolo* run, const char* channel, const int32_t* numbers, size_t count);
int tombolo_global_vertices_i64(tombolo* run, const char* channel, const int64_t* numbers, size_t count);
int tombolo_global_cells_i32(tombolo* run, const char* channel, const int32_t* numbers, size_t count);
int tombolo_global_cells_i64(tombolo* run, const char* channel, const int64_t* numbers, size_t count);

/* ---- Fields: for each of `count` vertices or cells 1 to 9 components, one beside the other. */

int tombolo_field_f32(tombolo* run, const char* channel, const char* name, enum tombolo_association association,
  const float* values, size_t count, int components);
int tombolo_field_f64(tombolo* run, const char* channel, const char* name, enum tombolo_association association,
  const double* values, size_t count, int components);
int tombolo_field_i32(tombolo* run, const char* channel, const char* name, enum tombolo_association association,
  const int32_t* values, size_t count, int components);
int tombolo_field_i64(tombolo* run, const char* channel, const char* name, enum tombolo_association association,
  const int64_t* values, size_t count, int components);
int tombolo_field_u8(tombolo* run, const char* channel, const char* name, enum tombolo_association association,
  const uint8_t* values, size_t count, int components);
/* A field that lies otherwise: the address of the first value of each component, and the bytes from one vertex or cell to the next. */
int tombolo_field_strided(tombolo* run, const char* channel, const char* name, enum tombolo_association association,
  enum tombolo_type type, const void* const* components, int component_count, size_t count, ptrdiff_t stride);

/* ---- What is gone. */

/* Forgets a field of this name, or the array "ghost_cells", "global_vertices" or "global_cells" of a channel, which the solver has freed or
 * has no more: it is not read again. NULL forgets the whole channel, which is there again once tombolo_points names it; features that
 * tombolo_execute has shown keep their names. Orders are rejected once the channel that they change is not shown any more. */
int tombolo_forget(tombolo* run, const char* channel, const char* name);

/* ---- Each step. */

/* Shows the state before the step from `time` to `time + time_step` (0 in a steady solver). A cycle beyond INT64_MAX is refused as the
 * negative number that it was before it was converted. */
int tombolo_execute(tombolo* run, uint64_t cycle, double time, double time_step);
/* Saves the state of the run in a file, which is there whole or not at all: the shape, the schedule under way, the orders that wait, the
 * parameters. To be called with the solver's own state at the end of the step that the last tombolo_execute has begun, on all ranks; an
 * error leaves an older file as it was. */
int tombolo_checkpoint(tombolo* run, const char* file);
/* Where the vertices of the channel that orders change are to be at the end of the step, x y z for each; NULL where the mesh
 * stays. Valid until the next tombolo_execute or the end. */
const double* tombolo_coordinates(tombolo* run);
/* The way there from where they are, and that way divided by the time step; valid as long. */
const double* tombolo_displacement(tombolo* run);
const double* tombolo_velocity(tombolo* run);
/* How many vertices these are of; 0 where the mesh stays. */
size_t tombolo_motion_count(tombolo* run);
/* The motion of the boundary's vertices alone, for a solver that moves its volume by itself (with "deform": {"method": "surface"} there
 * is no other): how many there are on this rank, which, counted from 0 and in one order in the whole run, and of each what the functions
 * above say of all. */
size_t tombolo_surface_count(tombolo* run);
const uint32_t* tombolo_surface_vertices(tombolo* run);
const double* tombolo_surface_coordinates(tombolo* run);
const double* tombolo_surface_displacement(tombolo* run);
const double* tombolo_surface_velocity(tombolo* run);
/* The name of the order whose motion it is, NULL where the mesh stays; valid until the next tombolo_execute or the end. */
const char* tombolo_motion_order(tombolo* run);
/* Which shape of that order's schedule this is, counted from 1, and how many there are; 0 and 0 where the mesh stays. */
int tombolo_motion_shape(tombolo* run, unsigned* shape, unsigned* shapes);
/* The value of a parameter now. */
int tombolo_parameter_value(tombolo* run, const char* name, double* value);
/* Ends the steering of the shape, for a solver that makes another mesh: orders are rejected with this reason from then on, views go on.
 * tombolo_execute does so by itself where it is shown other cells. */
int tombolo_release_shape(tombolo* run, const char* reason);
/* Asks the run to end, as a viewer can: from any thread, such as one that waits for SIGTERM, but not from a signal's handler. A run that is
 * paused goes on then, and the tombolo_execute that is under way, or the next, says that the run is stopped, on all ranks. It counts on
 * rank 0. */
int tombolo_stop(tombolo* run);
/* 1 once a tombolo_execute has said that the run is to end, on all ranks alike, else 0, and 0 while another thread is in a call; 1 of a
 * run that has ended or is not open. A run that was asked before its first tombolo_execute says so in it, and 0 until then. */
int tombolo_stopped(tombolo* run);

/* ---- Orders, on rank 0. */

size_t tombolo_order_count(tombolo* run);
/* What became of an order, counted from 0, as JSON: id, status, reason, cycle_applied, ... as in the report. Valid until the next
 * tombolo_execute, tombolo_finalize or tombolo_order of the same order. */
const char* tombolo_order(tombolo* run, size_t index);

/* ---- The end. */

/* Ends the run: viewers are disconnected, every thread has ended. Only the orders and the report can be asked for then. */
int tombolo_finalize(tombolo* run);
/* The report of a run that has ended, as JSON. Valid until tombolo_close. */
const char* tombolo_report(tombolo* run);
/* Closes a run, which ends it where that was not done, before MPI_Finalize; `*run` is NULL from then on. Nothing to do where it is
 * NULL already. */
int tombolo_close(tombolo** run);

#ifdef __cplusplus
}
#endif

#endif
