! Sections of arrays, as solvers in Fortran have them, lent to the module `tombolo`: what is written of each shows the values that it
! has at the time, or the call is an error.
module listener
  use, intrinsic :: iso_c_binding, only: c_int
  use tombolo
  implicit none
  integer :: told = 0
contains
  subroutine listen(level, message)
    integer(c_int), intent(in) :: level
    character(len=*), intent(in) :: message
    if (level == TOMBOLO_LOG_WARNING .and. index(message, "'lost'") > 0) told = told + 1
  end subroutine

  ! Takes the place of `listen` only where that is not refused.
  subroutine ignore(level, message)
    integer(c_int), intent(in) :: level
    character(len=*), intent(in) :: message
    if (level >= 0 .and. message /= "") told = told - 100
  end subroutine
end module listener

program sections
  use, intrinsic :: iso_fortran_env, only: int32, int64, real32, real64
  use listener
  use tombolo
  implicit none

  integer, parameter :: n = 5
  type(tombolo_run) :: run
  real(real64), allocatable, target :: store(:, :), places(:, :), columns(:, :), unallocated(:)
  real(real64), pointer :: bounds(:, :), moved(:, :)
  real(real32), target :: single(2 * n), pairs(2, n)
  integer(int32), target :: small(2 * n), tets(4, 2), wide(8, 2), faces(3, 6), features(6), gaps(12)
  integer(int64), target :: large(3, n), long_tets(4, 2)
  real(real64), target :: odd(2 * n)
  integer :: wrong, cycle, row, i

  wrong = 0
  allocate (store(7, 2 * n), places(4, 2 * n), columns(n, 3), bounds(0:2, -2:2))
  places = -1
  places(1:3, 1:2 * n:2) = reshape(real([0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1, 1, 1, 1], real64), [3, n])
  tets = reshape([0, 1, 2, 3, 1, 4, 2, 3], [4, 2])
  long_tets = tets
  wide = 0
  wide(1:4, :) = tets
  faces = reshape([0, 1, 2, 0, 1, 3, 0, 2, 3, 1, 2, 4, 1, 3, 4, 2, 3, 4], [3, 6])
  features = [1, 1, 1, 2, 2, 2]
  gaps = 0

  call right(tombolo_open("", TOMBOLO_COMM_WORLD, run))
  call right(tombolo_configure(run, '{"version": 1, "pipelines": [{"name": "all", "stages": [{"write": {"file": "all-{cycle:1}.vtu"}}]}]}'))
  call right(tombolo_points(run, "solid", places(1:3, 1:2 * n:2)))
  call right(tombolo_cells(run, "solid", TOMBOLO_TETRA, long_tets))
  call right(tombolo_cells(run, "solid", TOMBOLO_TETRA, tets))
  call right(tombolo_faces(run, "solid", TOMBOLO_TRIANGLE, faces, features))
  call right(tombolo_feature(run, "solid", 1_int64, "low"))
  call right(tombolo_feature(run, "solid", 2, "high"))
  call right(tombolo_field(run, "solid", "row", TOMBOLO_VERTEX, store(1, 1:n)))
  call right(tombolo_field(run, "solid", "every", TOMBOLO_VERTEX, store(1, 2:2 * n:2)))
  call right(tombolo_field(run, "solid", "rows", TOMBOLO_VERTEX, store(1:3, 1:n)))
  call right(tombolo_field(run, "solid", "apart", TOMBOLO_VERTEX, store(2:6:2, 1:2 * n:2)))
  call right(tombolo_field(run, "solid", "columns", TOMBOLO_VERTEX, columns(:, 1), columns(:, 2), columns(:, 3)))
  call right(tombolo_field(run, "solid", "bounds", TOMBOLO_VERTEX, bounds))
  call right(tombolo_field(run, "solid", "single", TOMBOLO_VERTEX, single(1:2 * n:2)))
  call right(tombolo_field(run, "solid", "pairs", TOMBOLO_VERTEX, pairs))
  call right(tombolo_field(run, "solid", "small", TOMBOLO_VERTEX, small(2:2 * n:2)))
  call right(tombolo_field(run, "solid", "large", TOMBOLO_VERTEX, large))
  call right(tombolo_field(run, "solid", "of cells", TOMBOLO_CELL, store(7, 1:2)))
  call assumed(store(1:3, 1:2 * n:2))

  ! What is not contiguous where it must be, lies backwards, or does not fit.
  call refused(tombolo_cells(run, "solid", TOMBOLO_TETRA, wide(1:4, :)), "channel 'solid', cells: found a section with gaps; expected a contiguous array")
  call refused(tombolo_cells(run, "solid", TOMBOLO_TETRA, faces), "cells: found an array with 3 rows; expected 4, the vertices of each along the first dimension")
  call refused(tombolo_faces(run, "solid", TOMBOLO_TRIANGLE, faces, gaps(1:12:2)), "faces, features: found a section with gaps")
  call refused(tombolo_faces(run, "solid", TOMBOLO_TRIANGLE, faces, features(1:5)), "faces, features: found 5 numbers; expected 6, one for each face")
  call refused(tombolo_field(run, "solid", "row", TOMBOLO_VERTEX, store(1, n:1:-1)), "field 'row': found a stride of -56 bytes; expected 8 or more")
  call refused(tombolo_field(run, "solid", "row", TOMBOLO_VERTEX, unallocated), "field 'row': found an array that is not allocated")
  call refused(tombolo_field(run, "solid", "row", TOMBOLO_VERTEX, columns(:, 1), store(1, 1:n)), "field 'row': found components whose values are 8 and 56 bytes apart; expected one stride for all")
  call refused(tombolo_field(run, "solid", "row", TOMBOLO_VERTEX, columns(:, 1), columns(1:3, 2)), "field 'row': found components of 5 and 3 values")
  call refused(tombolo_points(run, "solid", columns), "channel 'solid', points: found 5 components; expected 2 to 3")
  call refused(tombolo_field(run, "sold", "warm", TOMBOLO_VERTEX, columns), "did you mean 'solid'?")
  call right(tombolo_field(run, "solid", "warm", TOMBOLO_VERTEX, odd(1:2 * n:2)))

  do cycle = 0, 1
    do i = 1, 2 * n
      store(:, i) = [(1000d0 * cycle + 100 * row + i, row = 1, 7)]
    end do
    columns = reshape([(1000d0 * cycle + i, i = 1, 3 * n)], [n, 3])
    bounds = reshape([(1000d0 * cycle + i, i = 1, 3 * n)], [3, n])
    single = [(1000.5 * cycle + i, i = 1, 2 * n)]
    pairs = reshape([(1000.5 * cycle + i, i = 1, 2 * n)], [2, n])
    small = [(1000 * cycle + i, i = 1, 2 * n)]
    large = reshape([(1000 * cycle + i, i = 1, 3 * n)], [3, n])
    odd = 0
    if (cycle == 0) then
      call right(tombolo_execute(run, cycle, 0d0, 0.1d0))
    else
      call right(tombolo_execute(run, int(cycle, int64), 0.1d0, 0.1d0))
    end if
    moved => tombolo_coordinates(run)
    if (associated(moved)) wrong = wrong + 1
  end do
  call right(tombolo_forget(run, "solid", "row"))
  call refused(tombolo_forget(run, "solid", "row"), "channel 'solid', what to forget: found 'row'; expected one that was named")
  call right(tombolo_forget(run, "solid"))
  call refused(tombolo_forget(run, "solid"), "channel: found 'solid'; expected one that tombolo_points has named; none has been yet")
  call right(tombolo_finalize(run))
  if (tombolo_report(run) == "" .or. tombolo_version() == "") wrong = wrong + 1
  call right(tombolo_close(run))
  call refused(tombolo_start(run), "the run is a null pointer")

  call boundary()

  ! Three arrays of coordinates, and messages to a procedure.
  call right(tombolo_log(TOMBOLO_LOG_WARNING, listen))
  call refused(tombolo_log(9, ignore), "log: found the level 9; expected one of enum tombolo_level")
  call right(tombolo_open("", TOMBOLO_COMM_WORLD, run))
  call right(tombolo_configure(run, '{"version": 1, "pipelines": [{"name": "lost", "channel": "fluid", "stages": [{"quality": {}}]}]}'))
  call right(tombolo_points(run, "solid", columns(:, 1), columns(:, 2), columns(:, 3)))
  call right(tombolo_point_cells(run, "solid"))
  call right(tombolo_execute(run, 0, 0d0, 0.1d0))
  call right(tombolo_close(run))
  call right(tombolo_log(TOMBOLO_LOG_WARNING))
  if (told /= 1) then
    write (0, '(a, i0)') "messages: ", told
    wrong = wrong + 1
  end if
  deallocate (store, places, columns, bounds)
  if (wrong > 0) error stop 1

contains

  subroutine assumed(values)
    real(real64), intent(in), target :: values(:, :)
    call right(tombolo_field(run, "solid", "assumed", TOMBOLO_VERTEX, values))
  end subroutine

  ! A box of cubes whose upper side goes down, of which the boundary's motion is taken.
  subroutine boundary()
    integer, parameter :: side = 4
    real(real64), allocatable, target :: points(:, :)
    integer(int32), allocatable, target :: cubes(:, :)
    integer(int32), pointer :: vertices(:)
    real(real64), pointer :: all(:, :), surface(:, :)
    integer :: v, c, corner, low, motions
    integer, parameter :: corners(8) = [0, 1, side + 1, side, side**2, side**2 + 1, side**2 + side + 1, side**2 + side]
    allocate (points(3, side**3), cubes(8, (side - 1)**3))
    do v = 0, side**3 - 1
      points(:, v + 1) = real([mod(v, side), mod(v / side, side), v / side**2], real64) / (side - 1)
    end do
    do c = 0, (side - 1)**3 - 1
      low = mod(c, side - 1) + mod(c / (side - 1), side - 1) * side + c / (side - 1)**2 * side**2
      cubes(:, c + 1) = [(low + corners(corner), corner = 1, 8)]
    end do
    call right(tombolo_open("", TOMBOLO_COMM_WORLD, run))
    call right(tombolo_orders(run, '[{"at": {"cycle": 1}, "order": {"edits": [{"translate": {"region": {"half_space": ' // &
      '{"origin": [0, 0, 0.99], "normal": [0, 0, 1]}}, "fixed_region": {"half_space": {"origin": [0, 0, 0.01], ' // &
      '"normal": [0, 0, -1]}}, "by": [0, 0, -0.3]}}], "schedule": {"steps": 1}}}]'))
    call right(tombolo_points(run, "box", points))
    call right(tombolo_cells(run, "box", TOMBOLO_HEXAHEDRON, cubes))
    motions = 0
    do v = 0, 2
      call right(tombolo_execute(run, v, 0.5d0 * v, 0.5d0))
      vertices => tombolo_surface_vertices(run)
      if (.not. associated(vertices)) cycle
      motions = motions + 1
      all => tombolo_coordinates(run)
      surface => tombolo_surface_coordinates(run)
      if (size(vertices) /= side**3 - (side - 2)**3 .or. any(shape(surface) /= [3, size(vertices)])) wrong = wrong + 1
      if (any(all(:, vertices + 1) /= surface)) wrong = wrong + 1
      surface => tombolo_surface_displacement(run)
      if (any(abs(all(:, vertices + 1) - points(:, vertices + 1) - surface) > 1d-15)) wrong = wrong + 1
      if (any(abs(tombolo_surface_velocity(run) - surface / 0.5d0) > 1d-15)) wrong = wrong + 1
      if (tombolo_motion_order(run) == "") wrong = wrong + 1
      points = all
    end do
    if (motions /= 1 .or. abs(maxval(points(3, :)) - 0.7d0) > 1d-9) wrong = wrong + 1
    if (tombolo_order_count(run) /= 1 .or. index(tombolo_order(run, 1), '"applied"') == 0) wrong = wrong + 1
    call right(tombolo_close(run))
  end subroutine

  subroutine right(status)
    integer, intent(in) :: status
    if (status == TOMBOLO_OK) return
    write (0, '(a)') "an error: " // tombolo_message()
    wrong = wrong + 1
  end subroutine

  subroutine refused(status, words)
    integer, intent(in) :: status
    character(len=*), intent(in) :: words
    if (status /= TOMBOLO_OK .and. index(tombolo_message(), words) > 0) return
    write (0, '(a, i0, 4a)') "status ", status, ": ", tombolo_message(), "; expected: ", words
    wrong = wrong + 1
  end subroutine
end program sections
