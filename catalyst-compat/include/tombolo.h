/* Tombolo for solvers that want no conduit node: watch a running simulation in a browser, and change the shape of its domain while
 * it runs.
 *
 *   tombolo* run = tombolo_create();
 *   tombolo_configure_file(run, "pipelines.json");
 *   tombolo_initialize(run);
 *   for each step:
 *     tombolo_mesh(...), tombolo_cells(...), tombolo_field(...)   once, and again where an array has moved in memory
 *     tombolo_execute(run, cycle, time, time_step);
 *     coordinates = tombolo_coordinates(run);                     NULL: the mesh stays
 *   tombolo_finalize(run);
 *   tombolo_destroy(run);
 *
 * Arrays are borrowed, not copied: those that were named last are read inside tombolo_execute and at no other time. Every function
 * that answers with an int answers TOMBOLO_OK or another status; tombolo_message() then says what, where, and what was expected.
 * Nothing was changed then, and the solver may go on. On several ranks of MPI all call tombolo_initialize, tombolo_execute and
 * tombolo_finalize; an error of one rank is that of all. A handle is used by one thread at a time. */
#ifndef TOMBOLO_H
#define TOMBOLO_H

#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

/* A run: being set up, under way, or ended. */
typedef struct tombolo tombolo;

enum tombolo_status
{
  TOMBOLO_OK = 0,
  TOMBOLO_WRONG_CALL = 1,   /* before tombolo_initialize, after tombolo_finalize, or with a null pointer */
  TOMBOLO_INVALID = 100,    /* an argument, an array or a file that makes no sense */
  TOMBOLO_FAILED = 102      /* the run could not be set up, or a file not be written */
};

/* Types of numbers. */
enum tombolo_type
{
  TOMBOLO_INT32 = 5,
  TOMBOLO_INT64 = 6,
  TOMBOLO_UINT8 = 7,
  TOMBOLO_UINT32 = 9,
  TOMBOLO_UINT64 = 10,
  TOMBOLO_FLOAT32 = 11,
  TOMBOLO_FLOAT64 = 12
};

/* What a field has one value for. */
enum tombolo_association
{
  TOMBOLO_VERTEX = 0,
  TOMBOLO_ELEMENT = 1
};

/* Types of cells: VTK's numbers, and VTK's order of their vertices. */
enum tombolo_cell
{
  TOMBOLO_POINT = 1,
  TOMBOLO_LINE = 3,
  TOMBOLO_TRIANGLE = 5,
  TOMBOLO_QUAD = 9,
  TOMBOLO_TETRA = 10,
  TOMBOLO_HEXAHEDRON = 12,
  TOMBOLO_WEDGE = 13,
  TOMBOLO_PYRAMID = 14
};

/* What the last call of this thread that went wrong says; never NULL, the thread's until its next call. */
const char* tombolo_message(void);

/* ---- Setting up. */

/* A new run; destroyed by tombolo_destroy. */
tombolo* tombolo_create(void);
void tombolo_destroy(tombolo* run);
/* The pipelines and the server, as JSON. Without it nothing is watched and nobody can steer. */
int tombolo_configure(tombolo* run, const char* json);
int tombolo_configure_file(tombolo* run, const char* file);
/* A file of orders that are carried out at their cycle, or a journal. */
int tombolo_orders_file(tombolo* run, const char* file);
/* The directory of files that pipelines write; else the current one. */
int tombolo_output(tombolo* run, const char* directory);
/* The communicator by its handle in Fortran (MPI_Comm_c2f); else the world where MPI runs. */
int tombolo_communicator(tombolo* run, int fortran_handle);
/* A number that can be steered, within its bounds. */
int tombolo_parameter(tombolo* run, const char* name, double value, double minimum, double maximum);
/* Begins. */
int tombolo_initialize(tombolo* run);
/* The link that a browser opens, cut to `bytes`; empty without a server. */
int tombolo_link(const tombolo* run, char* text, size_t bytes);

/* ---- The mesh. The first channel that is named is the one that orders change, or the one that the configuration's
 * pipeline with "on": "order" has as its channel; its vertices and cells stay the same. */

/* Coordinates of the vertices: `dimension` (2 or 3) values for each, `stride` values from one vertex to the next. */
int tombolo_mesh(tombolo* run, const char* channel, enum tombolo_type type, const void* coordinates, size_t vertices,
  int dimension, size_t stride);
/* Cells of one type: vertex numbers from 0 on, cell after cell. */
int tombolo_cells(tombolo* run, const char* channel, enum tombolo_cell cell, enum tombolo_type type,
  const void* connectivity, size_t cells);
/* Cells each of its own type; `sizes` and `connectivity` are of the same type. */
int tombolo_mixed_cells(tombolo* run, const char* channel, const unsigned char* cell_types, enum tombolo_type type,
  const void* sizes, size_t cells, const void* connectivity, size_t length);
/* Faces of the boundary (TOMBOLO_TRIANGLE or TOMBOLO_QUAD), each with the number of the feature that it belongs to. Without them
 * features are found at sharp edges. */
int tombolo_faces(tombolo* run, const char* channel, enum tombolo_cell cell, enum tombolo_type type,
  const void* connectivity, const void* features, size_t faces);
int tombolo_feature(tombolo* run, const char* channel, int64_t number, const char* name);
/* Numbers in the whole mesh, on several ranks: of vertices, of cells, or both; NULL for what is not known. */
int tombolo_global_numbers(
  tombolo* run, const char* channel, enum tombolo_type type, const void* vertices, const void* cells);
/* For each cell 1 where it is a copy of another rank's, else 0. */
int tombolo_ghosts(tombolo* run, const char* channel, const unsigned char* ghosts);
/* A field: `components` (1 to 9) values for each vertex or cell, `stride` values from one to the next. */
int tombolo_field(tombolo* run, const char* channel, const char* name, enum tombolo_association association,
  enum tombolo_type type, const void* values, int components, size_t stride);

/* ---- Each step. */

/* Shows the state before the step from `time` to `time + time_step` (0 in a steady solver). */
int tombolo_execute(tombolo* run, uint64_t cycle, double time, double time_step);
/* Where the vertices of the channel that orders change are to be at the end of the step, x y z for each; NULL where the mesh
 * stays. Valid until the next call of tombolo_execute. */
const double* tombolo_coordinates(const tombolo* run);
/* The same as the way from where they are, and divided by the time step. */
const double* tombolo_displacement(const tombolo* run);
const double* tombolo_velocity(const tombolo* run);
/* Which shape of its order's schedule this is, counted from 1, how many there are, and the order's name, cut to `bytes`. 0 and an
 * empty name where the mesh stays. */
int tombolo_schedule(const tombolo* run, unsigned* shape, unsigned* shapes, char* order, size_t bytes);
/* The value of a parameter now. */
int tombolo_parameter_value(const tombolo* run, const char* name, double* value);
/* 1 once the run is to end, else 0. */
int tombolo_stopped(const tombolo* run);

/* ---- Orders, on rank 0. */

size_t tombolo_order_count(const tombolo* run);
/* What became of an order, as JSON: id, status, reason, cycle_applied, ... as in the report. */
int tombolo_order(const tombolo* run, size_t index, char* json, size_t bytes);

/* ---- The end. */

/* Ends the run: viewers are disconnected, every thread has ended. */
int tombolo_finalize(tombolo* run);
/* The report of a run that has ended, as JSON; the run's. Empty before. */
const char* tombolo_report(const tombolo* run);

#ifdef __cplusplus
}
#endif

#endif
