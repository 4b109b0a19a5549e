/* Transient heat in a box of tetrahedra that may move while it is heated: linear finite elements, lumped mass, explicit steps, each
 * rank of MPI with a slab of the box. It knows nothing of Catalyst or Tombolo. */
#ifndef heat_h
#define heat_h

#include <mpi.h>
#include <stdint.h>

typedef struct
{
  MPI_Comm ranks;
  int rank, size;
  int cells;             /* cubes along each edge of the box, in six tetrahedra each */
  int first, slabs;      /* the slabs of cubes that this rank has, along x */
  int vertices, tets, faces;
  double* coordinates;   /* x y z for each vertex */
  double* temperature;   /* one for each vertex */
  double* velocity;      /* of the mesh, x y z for each vertex; 0 where it rests */
  int32_t* connectivity; /* four vertices for each tetrahedron */
  int32_t* triangles;    /* three vertices for each face of the box */
  int32_t* features;     /* 1 to 6 for each face: x-min, x-max, y-min, y-max, z-min, z-max */
  int64_t* numbers;      /* of the vertices in the whole box */
  double* mass;
  double* rate;
} heat;

/* A unit box, cold but for the side x = 0, which is kept at 1; the side x = 1 is kept at 0. */
heat heat_create(MPI_Comm ranks, int cells);
void heat_destroy(heat* self);
/* One step on the mesh as it lies, which moves at `velocity` meanwhile. The caller moves the coordinates.
 * Small tetrahedra make it several shorter steps. */
void heat_step(heat* self, double conductivity, double time_step);
/* Of the whole box. */
double heat_volume(const heat* self);
double heat_mean(const heat* self);

#endif
