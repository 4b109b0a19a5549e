! The command line, and rest between two steps.
module pace
  use, intrinsic :: iso_c_binding, only: c_int
  implicit none

  interface
    function c_usleep(microseconds) bind(C, name="usleep") result(left)
      import :: c_int
      integer(c_int), value :: microseconds
      integer(c_int) :: left
    end function
  end interface

contains

  integer function argument(position, otherwise)
    integer, intent(in) :: position, otherwise
    character(len=32) :: text
    integer :: status
    argument = otherwise
    call get_command_argument(position, text)
    if (len_trim(text) == 0) return
    read (text, *, iostat=status) argument
    if (status /= 0) argument = otherwise
  end function

  subroutine rest(milliseconds)
    integer, intent(in) :: milliseconds
    integer(c_int) :: left
    if (milliseconds > 0) left = c_usleep(1000 * int(milliseconds, c_int))
  end subroutine
end module pace
