/* The calls of MPI that the examples make, for one process: they build without MPI by it. */
#ifndef serial_mpi_h
#define serial_mpi_h

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

typedef int MPI_Comm;
typedef int MPI_Fint;
#define MPI_COMM_WORLD 0
#define MPI_DOUBLE ((int)sizeof(double))
#define MPI_SUM 0
#define MPI_MAX 1
#define MPI_STATUS_IGNORE NULL

static inline int MPI_Init(int* count, char*** arguments)
{
  (void)count;
  (void)arguments;
  return 0;
}
static inline int MPI_Finalize(void) { return 0; }
static inline int MPI_Abort(MPI_Comm ranks, int status)
{
  (void)ranks;
  exit(status);
}
/* No handle of MPI's: whoever gets it takes all ranks there are. */
static inline MPI_Fint MPI_Comm_c2f(MPI_Comm ranks)
{
  (void)ranks;
  return -1;
}
static inline int MPI_Comm_rank(MPI_Comm ranks, int* rank)
{
  (void)ranks;
  *rank = 0;
  return 0;
}
static inline int MPI_Comm_size(MPI_Comm ranks, int* size)
{
  (void)ranks;
  *size = 1;
  return 0;
}
static inline int MPI_Allreduce(const void* own, void* all, int count, int type, int operation, MPI_Comm ranks)
{
  (void)operation;
  (void)ranks;
  memcpy(all, own, (size_t)count * (size_t)type);
  return 0;
}
/* One process has nobody to send to. */
static inline int MPI_Sendrecv(const void* sent, int count, int type, int to, int tag, void* received, int received_count,
  int received_type, int from, int received_tag, MPI_Comm ranks, void* status)
{
  (void)sent, (void)count, (void)type, (void)to, (void)tag, (void)received, (void)received_count, (void)received_type;
  (void)from, (void)received_tag, (void)ranks, (void)status;
  fprintf(stderr, "MPI_Sendrecv: there is one process only\n");
  exit(1);
}

#endif
