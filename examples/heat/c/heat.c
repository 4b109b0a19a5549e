#include "heat.h"

#include <stdlib.h>
#include <string.h>

static void* allocate(int count, size_t bytes) { return calloc((size_t)(count > 0 ? count : 1), bytes); }

static int begin(const heat* self, int rank) { return (int)((long)self->cells * rank / self->size); }

/* The rank with the next slab before (-1) or after (+1) this one's; itself where there is none. Ranks without slabs are passed over. */
static int neighbour(const heat* self, int side)
{
  for (int rank = self->rank + side; rank >= 0 && rank < self->size; rank += side)
    if (begin(self, rank + 1) > begin(self, rank)) return rank;
  return self->rank;
}

heat heat_create(MPI_Comm ranks, int cells)
{
  static const int paths[6][3] = {
    { 0, 1, 2 }, { 1, 2, 0 }, { 2, 0, 1 }, { 0, 2, 1 }, { 2, 1, 0 }, { 1, 0, 2 }
  };
  heat self = { .ranks = ranks, .cells = cells };
  MPI_Comm_rank(ranks, &self.rank);
  MPI_Comm_size(ranks, &self.size);
  self.first = begin(&self, self.rank);
  self.slabs = begin(&self, self.rank + 1) - self.first;
  const int side = cells + 1, plane = side * side;
  self.vertices = self.slabs > 0 ? (self.slabs + 1) * plane : 0;
  self.tets = 6 * self.slabs * cells * cells;
  const int ends = self.slabs > 0 ? (self.first == 0) + (self.first + self.slabs == cells) : 0;
  self.faces = 8 * self.slabs * cells + 2 * ends * cells * cells;

  self.coordinates = allocate(3 * self.vertices, sizeof(double));
  self.temperature = allocate(self.vertices, sizeof(double));
  self.velocity = allocate(3 * self.vertices, sizeof(double));
  self.mass = allocate(self.vertices, sizeof(double));
  self.rate = allocate(self.vertices, sizeof(double));
  self.connectivity = allocate(4 * self.tets, sizeof(int32_t));
  self.triangles = allocate(3 * self.faces, sizeof(int32_t));
  self.features = allocate(self.faces, sizeof(int32_t));
  self.numbers = allocate(self.vertices, sizeof(int64_t));

  for (int v = 0; v < self.vertices; ++v) {
    const int at[3] = { self.first + v / plane, v / side % side, v % side };
    for (int axis = 0; axis < 3; ++axis) self.coordinates[3 * v + axis] = (double)at[axis] / cells;
    self.numbers[v] = (int64_t)self.first * plane + v;
    self.temperature[v] = at[0] == 0 ? 1.0 : 0.0;
  }

  const int step[3] = { plane, side, 1 };
  int32_t* tet = self.connectivity;
  int32_t* triangle = self.triangles;
  int32_t* feature = self.features;
  for (int i = 0; i < self.slabs; ++i)
    for (int j = 0; j < cells; ++j)
      for (int k = 0; k < cells; ++k) {
        const int corner = i * plane + j * side + k;
        /* Along each order of the axes from the lowest corner of the cube to the highest. */
        for (int path = 0; path < 6; ++path, tet += 4) {
          tet[0] = corner;
          for (int edge = 0; edge < 3; ++edge) tet[edge + 1] = tet[edge] + step[paths[path][edge]];
          if (path >= 3) {
            const int32_t swapped = tet[1];
            tet[1] = tet[2];
            tet[2] = swapped;
          }
        }
        const int at[3] = { self.first + i, j, k };
        for (int axis = 0; axis < 3; ++axis)
          for (int end = 0; end < 2; ++end) {
            if (at[axis] != (end ? cells - 1 : 0)) continue;
            const int a = step[(axis + 1) % 3], b = step[(axis + 2) % 3];
            const int low = corner + end * step[axis], high = low + a + b;
            const int split[2][3] = { { low, low + a, high }, { low, high, low + b } };
            for (int half = 0; half < 2; ++half) {
              /* Seen from outside they run counter-clockwise. */
              for (int c = 0; c < 3; ++c) *triangle++ = split[half][end ? c : 2 - c];
              *feature++ = 1 + 2 * axis + end;
            }
          }
      }
  return self;
}

void heat_destroy(heat* self)
{
  free(self->coordinates);
  free(self->temperature);
  free(self->velocity);
  free(self->mass);
  free(self->rate);
  free(self->connectivity);
  free(self->triangles);
  free(self->features);
  free(self->numbers);
}

/* Gradients of the four shape functions of a tetrahedron, and its volume. */
static double gradients(const heat* self, const int32_t* tet, double gradient[4][3])
{
  const double* p[4];
  for (int c = 0; c < 4; ++c) p[c] = self->coordinates + 3 * tet[c];
  double edge[3][3];
  for (int e = 0; e < 3; ++e)
    for (int axis = 0; axis < 3; ++axis) edge[e][axis] = p[e + 1][axis] - p[0][axis];
  double normal[3][3];
  for (int e = 0; e < 3; ++e) {
    const double *a = edge[(e + 1) % 3], *b = edge[(e + 2) % 3];
    for (int axis = 0; axis < 3; ++axis)
      normal[e][axis] = a[(axis + 1) % 3] * b[(axis + 2) % 3] - a[(axis + 2) % 3] * b[(axis + 1) % 3];
  }
  const double six = edge[0][0] * normal[0][0] + edge[0][1] * normal[0][1] + edge[0][2] * normal[0][2];
  for (int axis = 0; axis < 3; ++axis) {
    gradient[0][axis] = 0.0;
    for (int e = 0; e < 3; ++e) {
      gradient[e + 1][axis] = normal[e][axis] / six;
      gradient[0][axis] -= gradient[e + 1][axis];
    }
  }
  return six / 6.0;
}

/* Adds what the neighbours have for the planes of vertices that are shared with them. */
static void share(const heat* self, double* values)
{
  const int plane = (self->cells + 1) * (self->cells + 1);
  if (self->slabs == 0) return;
  double* received = allocate(plane, sizeof(double));
  for (int side = -1; side <= 1; side += 2) {
    const int other = neighbour(self, side);
    if (other == self->rank) continue;
    double* own = side < 0 ? values : values + self->slabs * plane;
    MPI_Sendrecv(own, plane, MPI_DOUBLE, other, 0, received, plane, MPI_DOUBLE, other, 0, self->ranks, MPI_STATUS_IGNORE);
    for (int v = 0; v < plane; ++v) own[v] += received[v];
  }
  free(received);
}

static void part_of_step(heat* self, double conductivity, double time_step)
{
  memset(self->mass, 0, sizeof(double) * (size_t)self->vertices);
  memset(self->rate, 0, sizeof(double) * (size_t)self->vertices);
  for (int t = 0; t < self->tets; ++t) {
    const int32_t* tet = self->connectivity + 4 * t;
    double gradient[4][3], slope[3] = { 0, 0, 0 }, along = 0.0;
    const double volume = gradients(self, tet, gradient);
    for (int c = 0; c < 4; ++c)
      for (int axis = 0; axis < 3; ++axis) slope[axis] += gradient[c][axis] * self->temperature[tet[c]];
    for (int c = 0; c < 4; ++c)
      for (int axis = 0; axis < 3; ++axis) along += 0.25 * self->velocity[3 * tet[c] + axis] * slope[axis];
    for (int c = 0; c < 4; ++c) {
      double flux = 0.0;
      for (int axis = 0; axis < 3; ++axis) flux += gradient[c][axis] * slope[axis];
      self->mass[tet[c]] += 0.25 * volume;
      /* A vertex that moves passes through the temperature: the second term is that of the moving mesh. */
      self->rate[tet[c]] += volume * (0.25 * along - conductivity * flux);
    }
  }
  share(self, self->mass);
  share(self, self->rate);
  const int plane = (self->cells + 1) * (self->cells + 1);
  for (int v = 0; v < self->vertices; ++v) {
    const int i = self->first + v / plane;
    if (i > 0 && i < self->cells) self->temperature[v] += time_step * self->rate[v] / self->mass[v];
  }
}

void heat_step(heat* self, double conductivity, double time_step)
{
  /* Explicit steps are stable up to a length that the smallest tetrahedron sets: a step is taken in as many parts as that needs. */
  double own = 0.0, smallest = 0.0, gradient[4][3];
  for (int t = 0; t < self->tets; ++t) {
    double squares = 0.0;
    gradients(self, self->connectivity + 4 * t, gradient);
    for (int c = 0; c < 4; ++c)
      for (int axis = 0; axis < 3; ++axis) squares += gradient[c][axis] * gradient[c][axis];
    if (squares > own) own = squares;
  }
  MPI_Allreduce(&own, &smallest, 1, MPI_DOUBLE, MPI_MAX, self->ranks);
  const int parts = 1 + (int)(2.0 * conductivity * time_step * smallest);
  for (int part = 0; part < parts; ++part) part_of_step(self, conductivity, time_step / parts);
}

static double total(const heat* self, int of_temperature)
{
  double sum = 0.0, all = 0.0, gradient[4][3];
  for (int t = 0; t < self->tets; ++t) {
    const int32_t* tet = self->connectivity + 4 * t;
    double mean = 1.0;
    if (of_temperature) {
      mean = 0.0;
      for (int c = 0; c < 4; ++c) mean += 0.25 * self->temperature[tet[c]];
    }
    sum += mean * gradients(self, tet, gradient);
  }
  MPI_Allreduce(&sum, &all, 1, MPI_DOUBLE, MPI_SUM, self->ranks);
  return all;
}

double heat_volume(const heat* self) { return total(self, 0); }

double heat_mean(const heat* self) { return total(self, 1) / total(self, 0); }
