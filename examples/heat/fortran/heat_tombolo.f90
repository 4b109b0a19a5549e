! Heat, instrumented by the module `tombolo` in Fortran.
!
!   mpirun -n 3 heat_tombolo_fortran [STEPS [CELLS [MILLISECONDS-PER-STEP]]]
!
! TOMBOLO_PIPELINES names what to watch (else the surface is streamed), TOMBOLO_ORDERS orders known beforehand.
program heat_tombolo
  use, intrinsic :: iso_c_binding
  use mpi
  use heat
  use pace
  use tombolo
  implicit none

  character(len=*), parameter :: watch_the_surface = '{"version": 1, "stream": {"listen": "127.0.0.1:0"}, ' // &
    '"pipelines": [{"name": "surface", "stages": [{"surface": {}}, {"stream": {}}]}]}'
  character(len=5), parameter :: sides(6) = ["x-min", "x-max", "y-min", "y-max", "z-min", "z-max"]
  real(c_double), parameter :: time_step = 1d-3
  type(heat_solver), target :: solver
  type(tombolo_run) :: run
  real(c_double), pointer :: moved(:, :), velocity(:, :)
  real(c_double) :: conductivity, volume, mean
  character(len=1024) :: pipelines, orders
  integer :: steps, cells, milliseconds, step, side, order, error

  call MPI_Init(error)
  steps = argument(1, 100)
  cells = argument(2, 6)
  milliseconds = argument(3, 0)
  conductivity = 0.5d0
  call heat_create(solver, MPI_COMM_WORLD, cells)

  call get_environment_variable("TOMBOLO_PIPELINES", pipelines)
  call get_environment_variable("TOMBOLO_ORDERS", orders)
  call check(tombolo_open(pipelines, MPI_COMM_WORLD, run))
  if (pipelines == "") call check(tombolo_configure(run, watch_the_surface))
  if (orders /= "") call check(tombolo_orders_file(run, orders))
  call check(tombolo_parameter(run, "conductivity", conductivity, 0d0, 1d0))
  call check(tombolo_start(run))
  if (tombolo_link(run) /= "") write (0, '(2a)') "open ", tombolo_link(run)

  ! The arrays stay the solver's: nothing is copied.
  call check(tombolo_points(run, "solid", solver%coordinates))
  call check(tombolo_cells(run, "solid", TOMBOLO_TETRA, solver%connectivity))
  call check(tombolo_faces(run, "solid", TOMBOLO_TRIANGLE, solver%triangles, solver%features))
  do side = 1, 6
    call check(tombolo_feature(run, "solid", side, sides(side)))
  end do
  call check(tombolo_global_vertices(run, "solid", solver%numbers))
  call check(tombolo_field(run, "solid", "temperature", TOMBOLO_VERTEX, solver%temperature))

  do step = 0, steps - 1
    call check(tombolo_execute(run, step, time_step * step, time_step))
    call check(tombolo_parameter_value(run, "conductivity", conductivity))
    if (tombolo_stopped(run)) exit
    moved => tombolo_coordinates(run)
    velocity => tombolo_velocity(run)
    solver%velocity = 0
    if (associated(velocity)) solver%velocity = velocity
    call heat_step(solver, conductivity, time_step)
    if (associated(moved)) solver%coordinates = moved
    call rest(milliseconds)
  end do
  call heat_totals(solver, volume, mean)
  if (solver%rank == 0) &
    print '(a, f0.12, a, f0.12, a, f0.3)', 'volume ', volume, ' mean temperature ', mean, ' conductivity ', conductivity

  call check(tombolo_finalize(run))
  if (solver%rank == 0) print '(a)', (tombolo_order(run, order), order = 1, tombolo_order_count(run))
  call check(tombolo_close(run))
  call MPI_Finalize(error)

contains

  subroutine check(status)
    integer(c_int), intent(in) :: status
    integer :: error
    if (status == TOMBOLO_OK) return
    write (0, '(a)') tombolo_message()
    call MPI_Abort(MPI_COMM_WORLD, 1, error)
  end subroutine
end program heat_tombolo
