/* Three ranks of tombolo.h of which one goes wrong: all have its error, in the same call, and go on. */
#include <mpi.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <tombolo.h>

static int rank, wrong;

static void expect(const char* call, int status, const char* words)
{
  const int is_right = words ? status == TOMBOLO_INVALID && strstr(tombolo_message(), words) : status == TOMBOLO_OK;
  if (is_right) return;
  ++wrong;
  fprintf(stderr, "rank %d: %s: %d, '%s'; expected '%s'\n", rank, call, status, tombolo_message(), words ? words : "no error");
}
#define EXPECT(call, words) expect(#call, call, words)

int main(int argc, char** argv)
{
  static const int32_t tets[8] = { 0, 1, 2, 3, 1, 4, 2, 3 };
  static const int32_t triangles[18] = { 0, 1, 2, 0, 1, 3, 0, 2, 3, 1, 2, 4, 1, 3, 4, 2, 3, 4 };
  static const int32_t features[6] = { 1, 1, 1, 2, 2, 2 }, others[6] = { 1, 1, 1, 2, 2, 3 };
  static double field[5] = { 1, 2, 3, 4, 5 };
  double points[15] = { 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1, 1, 1, 1 };
  tombolo* run = NULL;
  MPI_Init(&argc, &argv);
  MPI_Comm_rank(MPI_COMM_WORLD, &rank);
  for (int p = 0; p < 5; ++p) points[3 * p] += 2 * rank;

  EXPECT(tombolo_open(rank == 1 ? "no-such-file.json" : NULL, MPI_Comm_c2f(MPI_COMM_WORLD), &run), "no-such-file.json: No such file");
  if (rank != 1 && !strstr(tombolo_message(), "rank 1: ")) ++wrong;
  EXPECT(tombolo_open(NULL, rank == 0 ? TOMBOLO_COMM_WORLD : MPI_Comm_c2f(MPI_COMM_WORLD), &run), NULL);
  EXPECT(tombolo_orders(run, "[{\"at\": {\"cycle\": 90}, \"order\": {\"undo\": 1}}]"), NULL);
  EXPECT(tombolo_execute(run, 0, 0.0, 0.1), "cycle 0: no channel was given");
  EXPECT(tombolo_points_f64(run, "solid", points, 5), NULL);
  if (rank != 2) EXPECT(tombolo_cells_i32(run, "solid", TOMBOLO_TETRA, tets, 2), NULL);
  EXPECT(tombolo_execute(run, 0, 0.0, 0.1), "channel 'solid': found points without cells");
  EXPECT(tombolo_cells_i32(run, "solid", TOMBOLO_TETRA, tets, 2), NULL);
  EXPECT(tombolo_field_f64(run, "solid", "warm", TOMBOLO_VERTEX, field, rank == 1 ? 4 : 5, 1), NULL);
  EXPECT(tombolo_execute(run, 0, 0.0, 0.1), "channel 'solid': field 'warm': found 4 tuples; expected 5");
  EXPECT(tombolo_field_f64(run, "solid", "warm", TOMBOLO_VERTEX, field, 5, 1), NULL);
  /* Feature 3 has its face on rank 2, feature 4 has none anywhere. */
  EXPECT(tombolo_faces_i32(run, "solid", TOMBOLO_TRIANGLE, triangles, rank == 2 ? others : features, 6), NULL);
  EXPECT(tombolo_feature(run, "solid", 3, "far"), NULL);
  if (rank == 1) EXPECT(tombolo_feature(run, "solid", 4, "lost"), NULL);
  EXPECT(tombolo_execute(run, 0, 0.0, 0.1), "feature 'lost' has the number 4, which no face has; the faces have 1, 2, 3");
  /* A text that one rank alone gets wrong holds none up. */
  if (rank == 0) {
    if (tombolo_checkpoint(run, NULL) != TOMBOLO_WRONG_CALL || !strstr(tombolo_message(), "file is a null pointer")) ++wrong;
    if (tombolo_release_shape(run, NULL) != TOMBOLO_WRONG_CALL) ++wrong;
  } else {
    EXPECT(tombolo_checkpoint(run, "ranks.state"), "rank 0: file is a null pointer");
    EXPECT(tombolo_release_shape(run, "another mesh"), "rank 0: the reason is a null pointer");
  }
  EXPECT(tombolo_checkpoint(run, rank == 1 ? "other.state" : "ranks.state"), "'file': found another one on other ranks, or none");
  EXPECT(tombolo_release_shape(run, rank == 2 ? "" : "another mesh"), "the reason: found \"\"");
  EXPECT(tombolo_release_shape(run, "another mesh"), NULL);
  EXPECT(tombolo_close(&run), NULL);
  int all = 0;
  MPI_Allreduce(&wrong, &all, 1, MPI_INT, MPI_SUM, MPI_COMM_WORLD);
  MPI_Finalize();
  return all > 0;
}
