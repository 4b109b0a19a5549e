! A run that is ended in the middle of an order and goes on from its checkpoint: at every step from there on its mesh is to the bit that
! of the run that was not interrupted. And the numbers that Fortran can get wrong where C cannot.
program restart
  use, intrinsic :: iso_fortran_env, only: int32, int64, real64
  use tombolo
  implicit none

  integer, parameter :: side = 5, points = side**3, cells = (side - 1)**3, steps = 16, last = 4
  integer, parameter :: corners(8) = [0, 1, side + 1, side, side**2, side**2 + 1, side**2 + side + 1, side**2 + side]
  character(len=*), parameter :: orders = '[{"id": "press", "at": {"cycle": 2}, "order": {"edits": [{"translate": {' // &
    '"region": {"half_space": {"origin": [0, 0, 3.99], "normal": [0, 0, 1]}}, ' // &
    '"fixed_region": {"half_space": {"origin": [0, 0, 0.01], "normal": [0, 0, -1]}}, "by": [0.1, 0, -0.7]}}], ' // &
    '"schedule": {"steps": 3, "every": {"steps": 2}}}}, ' // &
    '{"at": {"cycle": 10}, "order": {"undo": 1, "schedule": {"steps": 2, "every": {"steps": 1}}}}]'
  type(tombolo_run) :: run
  real(real64), target :: places(3, points)
  real(real64) :: rest(3, points), whole(3, points, 0:steps - 1)
  integer(int32), target :: cubes(8, cells)
  integer :: v, c, k, low, cycle, wrong, shape, shapes

  wrong = 0
  do v = 0, points - 1
    rest(:, v + 1) = real([mod(v, side), mod(v / side, side), v / side**2], real64)
  end do
  do c = 0, cells - 1
    low = mod(c, side - 1) + mod(c / (side - 1), side - 1) * side + c / (side - 1)**2 * side**2
    cubes(:, c + 1) = [(low + corners(k), k = 1, 8)]
  end do

  places = rest
  call begin()
  do cycle = 0, steps - 1
    call step()
    whole(:, :, cycle) = places
  end do
  call right(tombolo_close(run))
  call must(same(whole(:, :, 1), rest) .and. .not. same(whole(:, :, 9), rest), "the box moves")
  call must(same(whole(:, :, steps - 1), rest), "the box is back at rest")

  places = rest
  call begin()
  do cycle = 0, last
    call step()
  end do
  call right(tombolo_motion_shape(run, shape, shapes))
  call must(shape > 0 .and. shape < shapes, "the order is under way")
  call right(tombolo_checkpoint(run, "fortran.state"))
  call right(tombolo_close(run))

  call begin()
  call right(tombolo_restart(run, "fortran.state"))
  do cycle = last + 1, steps - 1
    call step()
    call must(same(places, whole(:, :, cycle)), "the same mesh after the restart")
  end do
  call must(tombolo_order_count(run) == 2, "two orders")
  call must(index(tombolo_order(run, 1), '"press"') > 0 .and. tombolo_order(run, 2) /= "", "orders are counted from 1")
  call must(tombolo_order(run, 0) == "", "no order 0")
  call must(tombolo_message() == "order: found 0; expected a number from 1 to 2", tombolo_message())
  call must(tombolo_order(run, 3) == "", "no order 3")
  call must(tombolo_message() == "order: found 3; expected a number from 1 to 2", tombolo_message())
  call must(tombolo_execute(run, -1, 4d0, 0.25d0) == TOMBOLO_INVALID, "no cycle -1")
  call must(tombolo_message() == "cycle: found -1; expected a whole number from 0 on", tombolo_message())
  call must(tombolo_execute(run, -2_int64, 4d0, 0.25d0) == TOMBOLO_INVALID, "no cycle -2")
  call must(tombolo_link(run) == "" .and. tombolo_watching_link(run) == "", "no server")
  call right(tombolo_release_shape(run, "the solver refines its mesh"))
  call must(.not. tombolo_stopped(run), "not stopped")
  call right(tombolo_stop(run))
  cycle = steps
  call step()
  call must(tombolo_stopped(run), "stopped")
  call right(tombolo_close(run))

  call right(tombolo_open("", TOMBOLO_COMM_WORLD, run))
  call must(tombolo_replay_file(run, "no-such-journal.jsonl") == TOMBOLO_INVALID, "no journal")
  call must(tombolo_order(run, 1) == "" .and. tombolo_message() == "order: found 1; expected no number, as there are no orders", &
    tombolo_message())
  call right(tombolo_close(run))
  if (wrong > 0) error stop 1

contains

  subroutine begin()
    call right(tombolo_open("", TOMBOLO_COMM_WORLD, run))
    call right(tombolo_orders(run, orders))
    call right(tombolo_points(run, "box", places))
    call right(tombolo_cells(run, "box", TOMBOLO_HEXAHEDRON, cubes))
  end subroutine

  subroutine step()
    real(real64), pointer :: to(:, :)
    call right(tombolo_execute(run, cycle, 0.25d0 * cycle, 0.25d0))
    to => tombolo_coordinates(run)
    if (associated(to)) places = to
  end subroutine

  ! Whether two boxes have the same bits.
  logical function same(one, other)
    real(real64), intent(in) :: one(:, :), other(:, :)
    same = all(transfer(one, 0_int64, size(one)) == transfer(other, 0_int64, size(other)))
  end function

  subroutine right(status)
    integer, intent(in) :: status
    call must(status == TOMBOLO_OK, tombolo_message())
  end subroutine

  subroutine must(holds, what)
    logical, intent(in) :: holds
    character(len=*), intent(in) :: what
    if (holds) return
    write (0, '(a, i0, 2a)') "cycle ", cycle, ": not so: ", what
    wrong = wrong + 1
  end subroutine
end program restart
