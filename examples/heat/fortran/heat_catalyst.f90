! Heat, instrumented by Catalyst 2 in Fortran.
!
!   export CATALYST_IMPLEMENTATION_NAME=tombolo
!   mpirun -n 3 heat_catalyst_fortran [STEPS [CELLS [MILLISECONDS-PER-STEP]]]
!
! TOMBOLO_PIPELINES names what to watch (else the surface is streamed), TOMBOLO_ORDERS orders known beforehand.
program heat_catalyst
  use, intrinsic :: iso_c_binding
  use mpi
  use catalyst_api
  use catalyst_conduit
  use heat
  use pace
  implicit none

  real(c_double), parameter :: time_step = 1d-3
  type(heat_solver), target :: solver
  type(c_ptr) :: setup, node, results
  real(c_double), allocatable :: moved(:, :)
  real(c_double) :: conductivity, volume, mean
  integer :: steps, cells, milliseconds, step, error
  logical :: moves

  call MPI_Init(error)
  steps = argument(1, 100)
  cells = argument(2, 6)
  milliseconds = argument(3, 0)
  conductivity = 0.5d0
  call heat_create(solver, MPI_COMM_WORLD, cells)

  setup = catalyst_conduit_node_create()
  call catalyst_conduit_node_set_path_int32(setup, "catalyst/mpi_comm", MPI_COMM_WORLD)
  call catalyst_conduit_node_set_path_float64(setup, "catalyst/parameters/conductivity/value", conductivity)
  call catalyst_conduit_node_set_path_float64(setup, "catalyst/parameters/conductivity/minimum", 0d0)
  call catalyst_conduit_node_set_path_float64(setup, "catalyst/parameters/conductivity/maximum", 1d0)
  call check(c_catalyst_initialize(setup), "catalyst_initialize")

  node = catalyst_conduit_node_create()
  call describe(node)
  allocate (moved(3, solver%vertices))
  do step = 0, steps - 1
    call catalyst_conduit_node_set_path_int64(node, "catalyst/state/timestep", int(step, c_int64_t))
    call catalyst_conduit_node_set_path_float64(node, "catalyst/state/time", time_step * step)
    call catalyst_conduit_node_set_path_float64(node, "catalyst/state/time_step", time_step)
    call check(c_catalyst_execute(node), "catalyst_execute")
    results = catalyst_conduit_node_create()
    call check(c_catalyst_results(results), "catalyst_results")
    conductivity = number(results, "catalyst/steering/fields/conductivity/values", conductivity)
    if (number(results, "catalyst/steering/fields/stop/values", 0d0) /= 0d0) exit
    moves = logical(catalyst_conduit_node_has_path(results, "catalyst/solid/coordsets/coords")) .and. solver%vertices > 0
    solver%velocity = 0
    if (moves) then
      call read_axes(results, "catalyst/solid/coordsets/coords/values/", moved)
      call read_axes(results, "catalyst/solid/fields/velocity/values/", solver%velocity)
    end if
    call catalyst_conduit_node_destroy(results)
    results = c_null_ptr
    call heat_step(solver, conductivity, time_step)
    if (moves) solver%coordinates = moved
    call rest(milliseconds)
  end do
  if (c_associated(results)) call catalyst_conduit_node_destroy(results)
  call heat_totals(solver, volume, mean)
  if (solver%rank == 0) &
    print '(a, f0.12, a, f0.12, a, f0.3)', 'volume ', volume, ' mean temperature ', mean, ' conductivity ', conductivity

  call check(c_catalyst_finalize(setup), "catalyst_finalize")
  call catalyst_conduit_node_destroy(setup)
  call catalyst_conduit_node_destroy(node)
  call MPI_Finalize(error)

contains

  ! Tells Catalyst of the arrays, which stay the solver's: nothing is copied.
  subroutine describe(node)
    type(c_ptr), intent(in) :: node
    character(len=5), parameter :: sides(6) = ["x-min", "x-max", "y-min", "y-max", "z-min", "z-max"]
    character(len=1), parameter :: axes(3) = ["x", "y", "z"]
    type(c_ptr) :: channel, mesh
    integer(c_size_t) :: vertices
    integer :: i
    channel = catalyst_conduit_node_fetch(node, "catalyst/channels/solid")
    call catalyst_conduit_node_set_path_char8_str(channel, "type", "mesh")
    do i = 1, 6
      call catalyst_conduit_node_set_path_int32(channel, "state/features/" // sides(i), i)
    end do
    mesh = catalyst_conduit_node_fetch(channel, "data")
    vertices = solver%vertices
    call catalyst_conduit_node_set_path_char8_str(mesh, "coordsets/coords/type", "explicit")
    do i = 1, 3
      call catalyst_conduit_node_set_path_external_float64_ptr_detailed(mesh, "coordsets/coords/values/" // axes(i), &
        solver%coordinates, vertices, 8_c_size_t * (i - 1), 24_c_size_t, 8_c_size_t, 0_c_size_t)
    end do
    call catalyst_conduit_node_set_path_char8_str(mesh, "topologies/mesh/type", "unstructured")
    call catalyst_conduit_node_set_path_char8_str(mesh, "topologies/mesh/coordset", "coords")
    call catalyst_conduit_node_set_path_char8_str(mesh, "topologies/mesh/elements/shape", "tet")
    call catalyst_conduit_node_set_path_external_int32_ptr(mesh, "topologies/mesh/elements/connectivity", &
      solver%connectivity, 4_c_size_t * solver%tets)
    call catalyst_conduit_node_set_path_char8_str(mesh, "topologies/boundary/type", "unstructured")
    call catalyst_conduit_node_set_path_char8_str(mesh, "topologies/boundary/coordset", "coords")
    call catalyst_conduit_node_set_path_char8_str(mesh, "topologies/boundary/elements/shape", "tri")
    call catalyst_conduit_node_set_path_external_int32_ptr(mesh, "topologies/boundary/elements/connectivity", &
      solver%triangles, 3_c_size_t * solver%faces)

    call catalyst_conduit_node_set_path_char8_str(mesh, "fields/temperature/association", "vertex")
    call catalyst_conduit_node_set_path_char8_str(mesh, "fields/temperature/topology", "mesh")
    call catalyst_conduit_node_set_path_external_float64_ptr(mesh, "fields/temperature/values", solver%temperature, vertices)
    ! Which side of the box each face belongs to, so that it can be seized by its name.
    call catalyst_conduit_node_set_path_char8_str(mesh, "fields/boundary_attribute/association", "element")
    call catalyst_conduit_node_set_path_char8_str(mesh, "fields/boundary_attribute/topology", "boundary")
    call catalyst_conduit_node_set_path_external_int32_ptr(mesh, "fields/boundary_attribute/values", &
      solver%features, int(solver%faces, c_size_t))
    ! The vertices' numbers in the whole box: what ranks share is known by them.
    call catalyst_conduit_node_set_path_char8_str(mesh, "fields/number/association", "vertex")
    call catalyst_conduit_node_set_path_char8_str(mesh, "fields/number/topology", "mesh")
    call catalyst_conduit_node_set_path_external_int64_ptr(mesh, "fields/number/values", solver%numbers, vertices)
    call catalyst_conduit_node_set_path_char8_str(mesh, "state/metadata/vtk_fields/number/attribute_type", "GlobalIds")
  end subroutine

  subroutine read_axes(node, path, vectors)
    type(c_ptr), intent(in) :: node
    character(len=*), intent(in) :: path
    real(c_double), intent(inout) :: vectors(:, :)
    character(len=1), parameter :: axes(3) = ["x", "y", "z"]
    real(c_double), pointer :: values(:)
    integer :: axis
    do axis = 1, 3
      call catalyst_conduit_node_fetch_path_as_float64_ptr(node, path // axes(axis), values)
      vectors(axis, :) = values
    end do
  end subroutine

  ! The number at a path, or another where there is none.
  real(c_double) function number(node, path, otherwise)
    type(c_ptr), intent(in) :: node
    character(len=*), intent(in) :: path
    real(c_double), intent(in) :: otherwise
    number = otherwise
    if (logical(catalyst_conduit_node_has_path(node, path))) number = catalyst_conduit_node_fetch_path_as_float64(node, path)
  end function

  subroutine check(status, call_name)
    integer(c_int), intent(in) :: status
    character(len=*), intent(in) :: call_name
    integer :: error
    if (status == catalyst_status_ok) return
    print '(2a, i0)', call_name, ' answers ', status
    call MPI_Abort(MPI_COMM_WORLD, 1, error)
  end subroutine
end program heat_catalyst
