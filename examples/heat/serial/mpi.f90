! The calls of MPI that the examples make, for one process: they build without MPI by it.
module mpi
  implicit none
  ! No handle of MPI's: whoever gets it takes all ranks there are.
  integer, parameter :: MPI_COMM_WORLD = -1
  integer, parameter :: MPI_DOUBLE_PRECISION = 0, MPI_SUM = 0, MPI_MAX = 1, MPI_STATUS_SIZE = 1
  integer :: MPI_STATUS_IGNORE(MPI_STATUS_SIZE)

contains

  subroutine MPI_Init(error)
    integer, intent(out) :: error
    error = 0
  end subroutine

  subroutine MPI_Finalize(error)
    integer, intent(out) :: error
    error = 0
  end subroutine

  subroutine MPI_Abort(ranks, status, error)
    integer, intent(in) :: ranks, status
    integer, intent(out) :: error
    error = ranks
    call exit(status)
  end subroutine

  subroutine MPI_Comm_rank(ranks, rank, error)
    integer, intent(in) :: ranks
    integer, intent(out) :: rank, error
    rank = 0 * ranks
    error = 0
  end subroutine

  subroutine MPI_Comm_size(ranks, size, error)
    integer, intent(in) :: ranks
    integer, intent(out) :: size, error
    size = 1 + 0 * ranks
    error = 0
  end subroutine

  subroutine MPI_Allreduce(own, all, count, type, operation, ranks, error)
    integer, intent(in) :: count, type, operation, ranks
    double precision, intent(in) :: own(count)
    double precision, intent(out) :: all(count)
    integer, intent(out) :: error
    all = own
    error = 0 * (type + operation + ranks)
  end subroutine

  ! One process has nobody to send to.
  subroutine MPI_Sendrecv(sent, count, type, to, tag, received, received_count, received_type, from, received_tag, ranks, &
    status, error)
    integer, intent(in) :: count, type, to, tag, received_count, received_type, from, received_tag, ranks
    double precision, intent(in) :: sent(count)
    double precision, intent(out) :: received(received_count)
    integer, intent(inout) :: status(MPI_STATUS_SIZE)
    integer, intent(out) :: error
    received = sent
    error = 0 * (type + to + tag + received_type + from + received_tag + ranks) + 0 * status(1)
    stop "MPI_Sendrecv: there is one process only"
  end subroutine
end module mpi
