/* A box of cubes, each side of which has a feature: `top` and `bottom` by name. For the programs of this directory. */
#ifndef box_h
#define box_h

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <tombolo.h>

enum { N = 4, S = N + 1, POINTS = S * S * S, CUBES = N * N * N, FACES = 6 * N * N };
static double points[3 * POINTS];
static int32_t cubes[8 * CUBES], quads[4 * FACES], features[FACES];

static inline void require(int holds, const char* what, int line)
{
  if (holds) return;
  fprintf(stderr, "line %d: %s; %s\n", line, what, tombolo_message());
  exit(1);
}
#define REQUIRE(holds) require(holds, #holds, __LINE__)
#define OK(call) require(!(call), #call, __LINE__)
/* A call that is refused in these words. */
#define REFUSED(call, words) require((call) == TOMBOLO_INVALID && strstr(tombolo_message(), words), #call, __LINE__)

/* The box at rest: of side N, with its lowest corner at the origin. */
static inline void rest(void)
{
  static const int corners[8] = { 0, 1, S + 1, S, S * S, S * S + 1, S * S + S + 1, S * S + S };
  static const int around[4][2] = { { 0, 0 }, { 1, 0 }, { 1, 1 }, { 0, 1 } };
  for (int v = 0; v < POINTS; ++v) {
    points[3 * v] = v % S;
    points[3 * v + 1] = v / S % S;
    points[3 * v + 2] = v / S / S;
  }
  for (int c = 0; c < CUBES; ++c)
    for (int k = 0; k < 8; ++k) cubes[8 * c + k] = c % N + c / N % N * S + c / N / N * S * S + corners[k];
  for (int f = 0; f < FACES; ++f) {
    const int side = f / N / N, axis = side / 2, a = f % N, b = f / N % N;
    for (int k = 0; k < 4; ++k) {
      int at[3];
      at[axis] = side % 2 * N;
      at[(axis + 1) % 3] = a + around[k][0];
      at[(axis + 2) % 3] = b + around[k][1];
      quads[4 * f + k] = at[0] + at[1] * S + at[2] * S * S;
    }
    features[f] = side;
  }
}

/* Names the points, cells and faces of the box. */
static inline void lend(tombolo* run)
{
  OK(tombolo_points_f64(run, "box", points, POINTS));
  OK(tombolo_cells_i32(run, "box", TOMBOLO_HEXAHEDRON, cubes, CUBES));
  OK(tombolo_faces_i32(run, "box", TOMBOLO_QUAD, quads, features, FACES));
  OK(tombolo_feature(run, "box", 4, "bottom"));
  OK(tombolo_feature(run, "box", 5, "top"));
}

/* Moves the box as it is asked to, if it is; says whether it was. */
static inline int follow(tombolo* run)
{
  const double* to = tombolo_coordinates(run);
  if (to) memcpy(points, to, sizeof points);
  return to != NULL;
}

#endif
