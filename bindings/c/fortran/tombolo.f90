! Tombolo for solvers in Fortran: the functions of tombolo.h, which says what each does.
!
!   type(tombolo_run) :: run
!   status = tombolo_open("pipelines.json", MPI_COMM_WORLD, run)
!   status = tombolo_points(run, "solid", coordinates)                    (3, points)
!   status = tombolo_cells(run, "solid", TOMBOLO_TETRA, tets)             (4, cells), counted from 0
!   status = tombolo_field(run, "solid", "temperature", TOMBOLO_VERTEX, temperature)
!   do step = 0, steps - 1
!     status = tombolo_execute(run, step, time, time_step)
!     moved => tombolo_coordinates(run)                                   not associated: the mesh stays
!   end do
!   status = tombolo_close(run)
!
! A status other than TOMBOLO_OK is explained by tombolo_message(). Texts are trimmed of blanks at their end.
!
! Arrays are lent, not copied: they stay where they are while tombolo_execute runs, and need the attribute `target` (or `pointer`),
! without which the compiler refuses the call. It refuses expressions, too, which have no place in memory. Never lend a section by a
! vector of indices, x([1, 3, 5]): it is a copy that ends with the call, which Fortran forbids here and gfortran does not see.
! Points and fields may be sections with strides, such as x(:, 1:n:2) or x(1, :), of real32 or real64, fields also of int32 or
! int64.
! Connectivities, of int32 or int64, and numbers are contiguous; what is not is an error.
!
! An array that a caller handed to your procedure with an explicit shape may be a copy that ends with the procedure: lend what you
! declared yourself, or what came with an assumed shape.
module tombolo
  use, intrinsic :: iso_c_binding
  use, intrinsic :: iso_fortran_env, only: int8, int32, int64, real32, real64
  implicit none
  private

  integer(c_int), parameter, public :: TOMBOLO_OK = 0, TOMBOLO_WRONG_CALL = 1, TOMBOLO_INVALID = 100, TOMBOLO_FAILED = 102
  integer(c_int), parameter, public :: TOMBOLO_VERTEX = 0, TOMBOLO_CELL = 1
  integer(c_int), parameter, public :: TOMBOLO_INFLOW = 1, TOMBOLO_OUTFLOW = 2, TOMBOLO_WALL = 3
  integer(c_int), parameter, public :: TOMBOLO_POINT = 1, TOMBOLO_LINE = 3, TOMBOLO_TRIANGLE = 5, TOMBOLO_QUAD = 9, &
    TOMBOLO_TETRA = 10, TOMBOLO_HEXAHEDRON = 12, TOMBOLO_WEDGE = 13, TOMBOLO_PYRAMID = 14, TOMBOLO_POLYGON = 7
  integer(c_int), parameter, public :: TOMBOLO_LOG_OFF = 0, TOMBOLO_LOG_ERROR = 1, TOMBOLO_LOG_WARNING = 2, &
    TOMBOLO_LOG_INFO = 3, TOMBOLO_LOG_DEBUG = 4
  ! All ranks where MPI runs, else this process.
  integer(c_int), parameter, public :: TOMBOLO_COMM_WORLD = -1

  ! A run: opened, begun, or ended.
  type, public :: tombolo_run
    private
    type(c_ptr) :: handle = c_null_ptr
  end type

  ! Where an array is that holds one component of points or of a field.
  type :: tombolo_column
    logical :: is_given = .true., is_allocated = .false.
    type(c_ptr) :: first = c_null_ptr
    integer(c_size_t) :: count = 0
    integer(c_ptrdiff_t) :: stride = 0
  end type

  ! Where all components of points or of a field are: each begins by itself, and all have one stride, in bytes.
  type :: tombolo_table
    logical :: is_allocated = .false.
    integer(c_int) :: kind = 0, dimension = 0
    type(c_ptr) :: first(9) = c_null_ptr
    integer(c_size_t) :: count = 0
    integer(c_ptrdiff_t) :: stride = 0
  end type

  abstract interface
    ! Takes what is told besides the errors of calls.
    subroutine tombolo_log_procedure(level, message)
      import :: c_int
      integer(c_int), intent(in) :: level
      character(len=*), intent(in) :: message
    end subroutine
  end interface
  public :: tombolo_log_procedure

  public :: tombolo_version, tombolo_message, tombolo_log
  public :: tombolo_open, tombolo_configure, tombolo_orders, tombolo_orders_file, tombolo_output, tombolo_parameter
  public :: tombolo_checkpoint, tombolo_restart, tombolo_replay_file, tombolo_release_shape, tombolo_stop
  public :: tombolo_condition, tombolo_start, tombolo_link, tombolo_watching_link, tombolo_finalize, tombolo_close, tombolo_report
  public :: tombolo_points, tombolo_cells, tombolo_mixed_cells, tombolo_point_cells, tombolo_ghost_cells
  public :: tombolo_faces, tombolo_feature, tombolo_global_vertices, tombolo_global_cells, tombolo_field, tombolo_forget
  public :: tombolo_execute, tombolo_coordinates, tombolo_displacement, tombolo_velocity
  public :: tombolo_surface_vertices, tombolo_surface_coordinates, tombolo_surface_displacement, tombolo_surface_velocity
  public :: tombolo_motion_order, tombolo_motion_shape, tombolo_parameter_value, tombolo_stopped
  public :: tombolo_order_count, tombolo_order

  integer(c_int), parameter :: INT32_TYPE = 5, INT64_TYPE = 6, FLOAT32_TYPE = 11, FLOAT64_TYPE = 12

  procedure(tombolo_log_procedure), pointer :: log_procedure => null()

  ! An array (2 or 3, points), or the two or three coordinates in an array each. With two of them orders that would move a vertex
  ! along z are rejected.
  interface tombolo_points
    procedure points_real32, points_real64, axes_real32, axes_real64
  end interface
  ! Of vertices counted from 0, (vertices of a cell, cells).
  interface tombolo_cells
    procedure cells_int32, cells_int64
  end interface
  interface tombolo_mixed_cells
    procedure mixed_cells_int32, mixed_cells_int64
  end interface
  ! Of vertices counted from 0, (vertices of a face, faces), and the number of each face's feature.
  interface tombolo_faces
    procedure faces_int32, faces_int64
  end interface
  interface tombolo_feature
    procedure feature_int32, feature_int64
  end interface
  interface tombolo_global_vertices
    procedure global_vertices_int32, global_vertices_int64
  end interface
  interface tombolo_global_cells
    procedure global_cells_int32, global_cells_int64
  end interface
  ! An array of one value for each vertex or cell, an array (components, vertices or cells), or up to three components in an array
  ! each.
  interface tombolo_field
    procedure field_real32, field_real64, field_int32, field_int64
    procedure components_real32, components_real64, components_int32, components_int64
  end interface
  interface tombolo_execute
    procedure execute_int32, execute_int64
  end interface

  interface
    function c_version() bind(C, name="tombolo_version") result(text)
      import :: c_ptr
      type(c_ptr) :: text
    end function
    function c_message() bind(C, name="tombolo_message") result(text)
      import :: c_ptr
      type(c_ptr) :: text
    end function
    function c_log(level, function, user_data) bind(C, name="tombolo_log") result(status)
      import :: c_funptr, c_int, c_ptr
      integer(c_int), value :: level
      type(c_funptr), value :: function
      type(c_ptr), value :: user_data
      integer(c_int) :: status
    end function
    function c_refuse(what, found, expected) bind(C, name="tombolo_refuse") result(status)
      import :: c_char, c_int
      character(kind=c_char), intent(in) :: what(*)
      character(kind=c_char), intent(in) :: found(*)
      character(kind=c_char), intent(in) :: expected(*)
      integer(c_int) :: status
    end function
    function c_vertices_of_cell(cell_type) bind(C, name="tombolo_vertices_of_cell") result(vertices)
      import :: c_int
      integer(c_int), value :: cell_type
      integer(c_int) :: vertices
    end function
    function c_open(file, communicator, run) bind(C, name="tombolo_open") result(status)
      import :: c_int, c_ptr
      type(c_ptr), value :: file
      integer(c_int), value :: communicator
      type(c_ptr), intent(out) :: run
      integer(c_int) :: status
    end function
    function c_configure(run, json) bind(C, name="tombolo_configure") result(status)
      import :: c_char, c_int, c_ptr
      type(c_ptr), value :: run
      character(kind=c_char), intent(in) :: json(*)
      integer(c_int) :: status
    end function
    function c_orders(run, json) bind(C, name="tombolo_orders") result(status)
      import :: c_char, c_int, c_ptr
      type(c_ptr), value :: run
      character(kind=c_char), intent(in) :: json(*)
      integer(c_int) :: status
    end function
    function c_orders_file(run, file) bind(C, name="tombolo_orders_file") result(status)
      import :: c_char, c_int, c_ptr
      type(c_ptr), value :: run
      character(kind=c_char), intent(in) :: file(*)
      integer(c_int) :: status
    end function
    function c_replay_file(run, file) bind(C, name="tombolo_replay_file") result(status)
      import :: c_char, c_int, c_ptr
      type(c_ptr), value :: run
      character(kind=c_char), intent(in) :: file(*)
      integer(c_int) :: status
    end function
    function c_output(run, directory) bind(C, name="tombolo_output") result(status)
      import :: c_char, c_int, c_ptr
      type(c_ptr), value :: run
      character(kind=c_char), intent(in) :: directory(*)
      integer(c_int) :: status
    end function
    function c_restart(run, file) bind(C, name="tombolo_restart") result(status)
      import :: c_char, c_int, c_ptr
      type(c_ptr), value :: run
      character(kind=c_char), intent(in) :: file(*)
      integer(c_int) :: status
    end function
    function c_checkpoint(run, file) bind(C, name="tombolo_checkpoint") result(status)
      import :: c_char, c_int, c_ptr
      type(c_ptr), value :: run
      character(kind=c_char), intent(in) :: file(*)
      integer(c_int) :: status
    end function
    function c_parameter(run, name, value, minimum, maximum) bind(C, name="tombolo_parameter") result(status)
      import :: c_char, c_double, c_int, c_ptr
      type(c_ptr), value :: run
      character(kind=c_char), intent(in) :: name(*)
      real(c_double), value :: value
      real(c_double), value :: minimum
      real(c_double), value :: maximum
      integer(c_int) :: status
    end function
    function c_condition(run, feature, condition) bind(C, name="tombolo_condition") result(status)
      import :: c_char, c_int, c_ptr
      type(c_ptr), value :: run
      character(kind=c_char), intent(in) :: feature(*)
      integer(c_int), value :: condition
      integer(c_int) :: status
    end function
    function c_start(run) bind(C, name="tombolo_start") result(status)
      import :: c_int, c_ptr
      type(c_ptr), value :: run
      integer(c_int) :: status
    end function
    function c_link(run) bind(C, name="tombolo_link") result(text)
      import :: c_ptr
      type(c_ptr), value :: run
      type(c_ptr) :: text
    end function
    function c_watching_link(run) bind(C, name="tombolo_watching_link") result(text)
      import :: c_ptr
      type(c_ptr), value :: run
      type(c_ptr) :: text
    end function
    function c_finalize(run) bind(C, name="tombolo_finalize") result(status)
      import :: c_int, c_ptr
      type(c_ptr), value :: run
      integer(c_int) :: status
    end function
    function c_report(run) bind(C, name="tombolo_report") result(text)
      import :: c_ptr
      type(c_ptr), value :: run
      type(c_ptr) :: text
    end function
    function c_close(run) bind(C, name="tombolo_close") result(status)
      import :: c_int, c_ptr
      type(c_ptr), intent(inout) :: run
      integer(c_int) :: status
    end function
    function c_points_strided(run, channel, kind, axes, dimension, count, stride) &
        bind(C, name="tombolo_points_strided") result(status)
      import :: c_char, c_int, c_ptr, c_ptrdiff_t, c_size_t
      type(c_ptr), value :: run
      character(kind=c_char), intent(in) :: channel(*)
      integer(c_int), value :: kind
      type(c_ptr), intent(in) :: axes(*)
      integer(c_int), value :: dimension
      integer(c_size_t), value :: count
      integer(c_ptrdiff_t), value :: stride
      integer(c_int) :: status
    end function
    function c_cells_i32(run, channel, cell_type, connectivity, cells) &
        bind(C, name="tombolo_cells_i32") result(status)
      import :: c_char, c_int, c_ptr, c_size_t
      type(c_ptr), value :: run
      character(kind=c_char), intent(in) :: channel(*)
      integer(c_int), value :: cell_type
      type(c_ptr), value :: connectivity
      integer(c_size_t), value :: cells
      integer(c_int) :: status
    end function
    function c_mixed_cells_i32(run, channel, cell_types, sizes, cells, connectivity, length) &
        bind(C, name="tombolo_mixed_cells_i32") result(status)
      import :: c_char, c_int, c_ptr, c_size_t
      type(c_ptr), value :: run
      character(kind=c_char), intent(in) :: channel(*)
      type(c_ptr), value :: cell_types
      type(c_ptr), value :: sizes
      integer(c_size_t), value :: cells
      type(c_ptr), value :: connectivity
      integer(c_size_t), value :: length
      integer(c_int) :: status
    end function
    function c_faces_i32(run, channel, face_type, connectivity, features, faces) &
        bind(C, name="tombolo_faces_i32") result(status)
      import :: c_char, c_int, c_ptr, c_size_t
      type(c_ptr), value :: run
      character(kind=c_char), intent(in) :: channel(*)
      integer(c_int), value :: face_type
      type(c_ptr), value :: connectivity
      type(c_ptr), value :: features
      integer(c_size_t), value :: faces
      integer(c_int) :: status
    end function
    function c_global_vertices_i32(run, channel, numbers, count) &
        bind(C, name="tombolo_global_vertices_i32") result(status)
      import :: c_char, c_int, c_ptr, c_size_t
      type(c_ptr), value :: run
      character(kind=c_char), intent(in) :: channel(*)
      type(c_ptr), value :: numbers
      integer(c_size_t), value :: count
      integer(c_int) :: status
    end function
    function c_global_cells_i32(run, channel, numbers, count) &
        bind(C, name="tombolo_global_cells_i32") result(status)
      import :: c_char, c_int, c_ptr, c_size_t
      type(c_ptr), value :: run
      character(kind=c_char), intent(in) :: channel(*)
      type(c_ptr), value :: numbers
      integer(c_size_t), value :: count
      integer(c_int) :: status
    end function
    function c_cells_i64(run, channel, cell_type, connectivity, cells) &
        bind(C, name="tombolo_cells_i64") result(status)
      import :: c_char, c_int, c_ptr, c_size_t
      type(c_ptr), value :: run
      character(kind=c_char), intent(in) :: channel(*)
      integer(c_int), value :: cell_type
      type(c_ptr), value :: connectivity
      integer(c_size_t), value :: cells
      integer(c_int) :: status
    end function
    function c_mixed_cells_i64(run, channel, cell_types, sizes, cells, connectivity, length) &
        bind(C, name="tombolo_mixed_cells_i64") result(status)
      import :: c_char, c_int, c_ptr, c_size_t
      type(c_ptr), value :: run
      character(kind=c_char), intent(in) :: channel(*)
      type(c_ptr), value :: cell_types
      type(c_ptr), value :: sizes
      integer(c_size_t), value :: cells
      type(c_ptr), value :: connectivity
      integer(c_size_t), value :: length
      integer(c_int) :: status
    end function
    function c_faces_i64(run, channel, face_type, connectivity, features, faces) &
        bind(C, name="tombolo_faces_i64") result(status)
      import :: c_char, c_int, c_ptr, c_size_t
      type(c_ptr), value :: run
      character(kind=c_char), intent(in) :: channel(*)
      integer(c_int), value :: face_type
      type(c_ptr), value :: connectivity
      type(c_ptr), value :: features
      integer(c_size_t), value :: faces
      integer(c_int) :: status
    end function
    function c_global_vertices_i64(run, channel, numbers, count) &
        bind(C, name="tombolo_global_vertices_i64") result(status)
      import :: c_char, c_int, c_ptr, c_size_t
      type(c_ptr), value :: run
      character(kind=c_char), intent(in) :: channel(*)
      type(c_ptr), value :: numbers
      integer(c_size_t), value :: count
      integer(c_int) :: status
    end function
    function c_global_cells_i64(run, channel, numbers, count) &
        bind(C, name="tombolo_global_cells_i64") result(status)
      import :: c_char, c_int, c_ptr, c_size_t
      type(c_ptr), value :: run
      character(kind=c_char), intent(in) :: channel(*)
      type(c_ptr), value :: numbers
      integer(c_size_t), value :: count
      integer(c_int) :: status
    end function
    function c_point_cells(run, channel) bind(C, name="tombolo_point_cells") result(status)
      import :: c_char, c_int, c_ptr
      type(c_ptr), value :: run
      character(kind=c_char), intent(in) :: channel(*)
      integer(c_int) :: status
    end function
    function c_forget(run, channel, name) bind(C, name="tombolo_forget") result(status)
      import :: c_char, c_int, c_ptr
      type(c_ptr), value :: run
      character(kind=c_char), intent(in) :: channel(*)
      type(c_ptr), value :: name
      integer(c_int) :: status
    end function
    function c_ghost_cells(run, channel, ghosts, cells) bind(C, name="tombolo_ghost_cells") result(status)
      import :: c_char, c_int, c_ptr, c_size_t
      type(c_ptr), value :: run
      character(kind=c_char), intent(in) :: channel(*)
      type(c_ptr), value :: ghosts
      integer(c_size_t), value :: cells
      integer(c_int) :: status
    end function
    function c_feature(run, channel, number, name) bind(C, name="tombolo_feature") result(status)
      import :: c_char, c_int, c_int64_t, c_ptr
      type(c_ptr), value :: run
      character(kind=c_char), intent(in) :: channel(*)
      integer(c_int64_t), value :: number
      character(kind=c_char), intent(in) :: name(*)
      integer(c_int) :: status
    end function
    function c_field_strided(run, channel, name, association, kind, components, component_count, count, stride) &
        bind(C, name="tombolo_field_strided") result(status)
      import :: c_char, c_int, c_ptr, c_ptrdiff_t, c_size_t
      type(c_ptr), value :: run
      character(kind=c_char), intent(in) :: channel(*)
      character(kind=c_char), intent(in) :: name(*)
      integer(c_int), value :: association
      integer(c_int), value :: kind
      type(c_ptr), intent(in) :: components(*)
      integer(c_int), value :: component_count
      integer(c_size_t), value :: count
      integer(c_ptrdiff_t), value :: stride
      integer(c_int) :: status
    end function
    function c_execute(run, cycle, time, time_step) bind(C, name="tombolo_execute") result(status)
      import :: c_double, c_int, c_int64_t, c_ptr
      type(c_ptr), value :: run
      integer(c_int64_t), value :: cycle
      real(c_double), value :: time
      real(c_double), value :: time_step
      integer(c_int) :: status
    end function
    function c_coordinates(run) bind(C, name="tombolo_coordinates") result(first)
      import :: c_ptr
      type(c_ptr), value :: run
      type(c_ptr) :: first
    end function
    function c_displacement(run) bind(C, name="tombolo_displacement") result(first)
      import :: c_ptr
      type(c_ptr), value :: run
      type(c_ptr) :: first
    end function
    function c_velocity(run) bind(C, name="tombolo_velocity") result(first)
      import :: c_ptr
      type(c_ptr), value :: run
      type(c_ptr) :: first
    end function
    function c_surface_vertices(run) bind(C, name="tombolo_surface_vertices") result(first)
      import :: c_ptr
      type(c_ptr), value :: run
      type(c_ptr) :: first
    end function
    function c_surface_coordinates(run) bind(C, name="tombolo_surface_coordinates") result(first)
      import :: c_ptr
      type(c_ptr), value :: run
      type(c_ptr) :: first
    end function
    function c_surface_displacement(run) bind(C, name="tombolo_surface_displacement") result(first)
      import :: c_ptr
      type(c_ptr), value :: run
      type(c_ptr) :: first
    end function
    function c_surface_velocity(run) bind(C, name="tombolo_surface_velocity") result(first)
      import :: c_ptr
      type(c_ptr), value :: run
      type(c_ptr) :: first
    end function
    function c_motion_count(run) bind(C, name="tombolo_motion_count") result(count)
      import :: c_ptr, c_size_t
      type(c_ptr), value :: run
      integer(c_size_t) :: count
    end function
    function c_surface_count(run) bind(C, name="tombolo_surface_count") result(count)
      import :: c_ptr, c_size_t
      type(c_ptr), value :: run
      integer(c_size_t) :: count
    end function
    function c_motion_order(run) bind(C, name="tombolo_motion_order") result(text)
      import :: c_ptr
      type(c_ptr), value :: run
      type(c_ptr) :: text
    end function
    function c_motion_shape(run, shape, shapes) bind(C, name="tombolo_motion_shape") result(status)
      import :: c_int, c_ptr
      type(c_ptr), value :: run
      integer(c_int), intent(out) :: shape
      integer(c_int), intent(out) :: shapes
      integer(c_int) :: status
    end function
    function c_parameter_value(run, name, value) bind(C, name="tombolo_parameter_value") result(status)
      import :: c_char, c_double, c_int, c_ptr
      type(c_ptr), value :: run
      character(kind=c_char), intent(in) :: name(*)
      real(c_double), intent(inout) :: value
      integer(c_int) :: status
    end function
    function c_release_shape(run, reason) bind(C, name="tombolo_release_shape") result(status)
      import :: c_char, c_int, c_ptr
      type(c_ptr), value :: run
      character(kind=c_char), intent(in) :: reason(*)
      integer(c_int) :: status
    end function
    function c_stop(run) bind(C, name="tombolo_stop") result(status)
      import :: c_int, c_ptr
      type(c_ptr), value :: run
      integer(c_int) :: status
    end function
    function c_stopped(run) bind(C, name="tombolo_stopped") result(stopped)
      import :: c_int, c_ptr
      type(c_ptr), value :: run
      integer(c_int) :: stopped
    end function
    function c_order_count(run) bind(C, name="tombolo_order_count") result(count)
      import :: c_ptr, c_size_t
      type(c_ptr), value :: run
      integer(c_size_t) :: count
    end function
    function c_order_by_number(run, number) bind(C, name="tombolo_order_by_number") result(text)
      import :: c_int64_t, c_ptr
      type(c_ptr), value :: run
      integer(c_int64_t), value :: number
      type(c_ptr) :: text
    end function
    function c_length(text) bind(C, name="strlen") result(length)
      import :: c_ptr, c_size_t
      type(c_ptr), value :: text
      integer(c_size_t) :: length
    end function
  end interface

contains

  function c_text(text)
    character(len=*), intent(in) :: text
    character(kind=c_char, len=len_trim(text) + 1) :: c_text
    c_text = trim(text) // c_null_char
  end function

  function from_c(first) result(text)
    type(c_ptr), intent(in) :: first
    character(len=:), allocatable :: text
    character(kind=c_char), pointer :: letters(:)
    integer :: i
    text = ""
    if (.not. c_associated(first)) return
    call c_f_pointer(first, letters, [c_length(first)])
    text = repeat(" ", size(letters))
    do i = 1, size(letters)
      text(i:i) = letters(i)
    end do
  end function

  ! An error of this module, in the words of all others.
  integer(c_int) function refuse(channel, what, found, expected) result(status)
    character(len=*), intent(in) :: channel, what, found, expected
    status = c_refuse(c_text("channel '" // trim(channel) // "', " // what), c_text(found), c_text(expected))
  end function

  function text_of(number) result(text)
    integer(c_size_t), intent(in) :: number
    character(len=:), allocatable :: text
    character(len=20) :: digits
    write (digits, '(i0)') number
    text = trim(digits)
  end function

  ! The bytes from one element to the next; where there is no next, those of the element itself.
  integer(c_ptrdiff_t) function distance(first, next)
    type(c_ptr), intent(in) :: first, next
    distance = transfer(next, 0_c_ptrdiff_t) - transfer(first, 0_c_ptrdiff_t)
  end function

  function tombolo_version() result(text)
    character(len=:), allocatable :: text
    text = from_c(c_version())
  end function

  function tombolo_message() result(text)
    character(len=:), allocatable :: text
    text = from_c(c_message())
  end function

  ! Hands messages up to a level to a procedure; without one, to standard error. Where it is refused, the procedure before stays.
  integer(c_int) function tombolo_log(level, procedure) result(status)
    integer(c_int), intent(in) :: level
    procedure(tombolo_log_procedure), optional :: procedure
    procedure(tombolo_log_procedure), pointer :: before
    if (present(procedure)) then
      before => log_procedure
      log_procedure => procedure
      status = c_log(level, c_funloc(forward), c_null_ptr)
      if (status /= TOMBOLO_OK) log_procedure => before
    else
      status = c_log(level, c_null_funptr, c_null_ptr)
    end if
  end function

  subroutine forward(level, message, user_data) bind(C)
    integer(c_int), value :: level
    type(c_ptr), value :: message, user_data
    if (associated(log_procedure) .and. .not. c_associated(user_data)) call log_procedure(level, from_c(message))
  end subroutine

  ! Of a file; of "" where tombolo_configure says what to watch, or nothing is watched.
  integer(c_int) function tombolo_open(file, communicator, run) result(status)
    character(len=*), intent(in) :: file
    integer(c_int), intent(in) :: communicator
    type(tombolo_run), intent(out) :: run
    character(kind=c_char, len=:), allocatable, target :: name
    name = c_text(file)
    if (file == "") then
      status = c_open(c_null_ptr, communicator, run%handle)
    else
      status = c_open(c_loc(name), communicator, run%handle)
    end if
  end function

  integer(c_int) function tombolo_configure(run, json) result(status)
    type(tombolo_run), intent(in) :: run
    character(len=*), intent(in) :: json
    status = c_configure(run%handle, c_text(json))
  end function

  integer(c_int) function tombolo_orders(run, json) result(status)
    type(tombolo_run), intent(in) :: run
    character(len=*), intent(in) :: json
    status = c_orders(run%handle, c_text(json))
  end function

  integer(c_int) function tombolo_orders_file(run, file) result(status)
    type(tombolo_run), intent(in) :: run
    character(len=*), intent(in) :: file
    status = c_orders_file(run%handle, c_text(file))
  end function

  integer(c_int) function tombolo_replay_file(run, file) result(status)
    type(tombolo_run), intent(in) :: run
    character(len=*), intent(in) :: file
    status = c_replay_file(run%handle, c_text(file))
  end function

  integer(c_int) function tombolo_output(run, directory) result(status)
    type(tombolo_run), intent(in) :: run
    character(len=*), intent(in) :: directory
    status = c_output(run%handle, c_text(directory))
  end function

  integer(c_int) function tombolo_restart(run, file) result(status)
    type(tombolo_run), intent(in) :: run
    character(len=*), intent(in) :: file
    status = c_restart(run%handle, c_text(file))
  end function

  integer(c_int) function tombolo_checkpoint(run, file) result(status)
    type(tombolo_run), intent(in) :: run
    character(len=*), intent(in) :: file
    status = c_checkpoint(run%handle, c_text(file))
  end function

  integer(c_int) function tombolo_parameter(run, name, value, minimum, maximum) result(status)
    type(tombolo_run), intent(in) :: run
    character(len=*), intent(in) :: name
    real(c_double), intent(in) :: value, minimum, maximum
    status = c_parameter(run%handle, c_text(name), value, minimum, maximum)
  end function

  integer(c_int) function tombolo_condition(run, feature, condition) result(status)
    type(tombolo_run), intent(in) :: run
    character(len=*), intent(in) :: feature
    integer(c_int), intent(in) :: condition
    status = c_condition(run%handle, c_text(feature), condition)
  end function

  integer(c_int) function tombolo_start(run) result(status)
    type(tombolo_run), intent(in) :: run
    status = c_start(run%handle)
  end function

  integer(c_int) function tombolo_finalize(run) result(status)
    type(tombolo_run), intent(in) :: run
    status = c_finalize(run%handle)
  end function

  integer(c_int) function tombolo_close(run) result(status)
    type(tombolo_run), intent(inout) :: run
    status = c_close(run%handle)
  end function

  ! The link that a browser opens; empty without a server.
  function tombolo_link(run) result(text)
    type(tombolo_run), intent(in) :: run
    character(len=:), allocatable :: text
    text = from_c(c_link(run%handle))
  end function

  ! The link of those who watch and can never drive; empty without a server.
  function tombolo_watching_link(run) result(text)
    type(tombolo_run), intent(in) :: run
    character(len=:), allocatable :: text
    text = from_c(c_watching_link(run%handle))
  end function

  function tombolo_report(run) result(text)
    type(tombolo_run), intent(in) :: run
    character(len=:), allocatable :: text
    text = from_c(c_report(run%handle))
  end function

  ! The name of the order whose motion it is; empty where the mesh stays.
  function tombolo_motion_order(run) result(text)
    type(tombolo_run), intent(in) :: run
    character(len=:), allocatable :: text
    text = from_c(c_motion_order(run%handle))
  end function

  ! Where the values of one array are, which holds one component of points or of a field.
  type(tombolo_column) function column_at(first, next, bytes, count) result(column)
    type(c_ptr), intent(in) :: first, next
    integer(c_ptrdiff_t), intent(in) :: bytes
    integer(c_size_t), intent(in) :: count
    column%is_allocated = .true.
    column%count = count
    if (count > 0) column%first = first
    column%stride = bytes
    if (count > 1) column%stride = distance(first, next)
  end function

  ! Components that have an array each, of one length and with one stride, as one table; an error where they do not go together.
  type(tombolo_table) function joined(columns, kind, channel, what, status) result(table)
    type(tombolo_column), intent(in) :: columns(:)
    integer(c_int), intent(in) :: kind
    character(len=*), intent(in) :: channel, what
    integer(c_int), intent(out) :: status
    integer :: component
    status = TOMBOLO_OK
    table%kind = kind
    table%is_allocated = .true.
    table%count = columns(1)%count
    table%stride = columns(1)%stride
    do component = 1, size(columns)
      associate (column => columns(component))
        if (.not. column%is_given) cycle
        if (.not. column%is_allocated) then
          status = refuse(channel, what, "an array that is not allocated", "an array for each component")
        else if (column%count /= table%count) then
          status = refuse(channel, what, "components of " // text_of(table%count) // " and " // text_of(column%count) // &
            " values", "as many of each")
        else if (column%stride /= table%stride) then
          status = refuse(channel, what, "components whose values are " // text_of(int(table%stride, c_size_t)) // " and " // &
            text_of(int(column%stride, c_size_t)) // " bytes apart", "one stride for all")
        end if
        if (status /= TOMBOLO_OK) return
        table%dimension = table%dimension + 1
        table%first(table%dimension) = column%first
      end associate
    end do
  end function

  integer(c_int) function lend_points(run, channel, table) result(status)
    type(tombolo_run), intent(in) :: run
    character(len=*), intent(in) :: channel
    type(tombolo_table), intent(in) :: table
    if (table%is_allocated) then
      status = c_points_strided(run%handle, c_text(channel), table%kind, table%first, table%dimension, table%count, table%stride)
    else
      status = refuse(channel, "points", "an array that is not allocated", "an array (2 or 3, points)")
    end if
  end function

  integer(c_int) function lend_field(run, channel, name, association, table) result(status)
    type(tombolo_run), intent(in) :: run
    character(len=*), intent(in) :: channel, name
    integer(c_int), intent(in) :: association
    type(tombolo_table), intent(in) :: table
    if (table%is_allocated) then
      status = c_field_strided(run%handle, c_text(channel), c_text(name), association, table%kind, table%first, &
        table%dimension, table%count, table%stride)
    else
      status = refuse(channel, "field '" // trim(name) // "'", "an array that is not allocated", "an array (components, values)")
    end if
  end function

  type(tombolo_column) function column_real32(values) result(column)
    real(real32), pointer, intent(in), optional :: values(:)
    type(c_ptr) :: first, next
    column%is_given = .false.
    if (.not. present(values)) return
    column%is_given = .true.
    if (.not. associated(values)) return
    first = c_null_ptr
    next = c_null_ptr
    if (size(values) > 0) first = c_loc(values(lbound(values, 1)))
    if (size(values) > 1) next = c_loc(values(lbound(values, 1) + 1))
    column = column_at(first, next, storage_size(values, c_ptrdiff_t) / 8, size(values, kind=c_size_t))
  end function

  ! Where each component of an array (components, values) begins, and how far its values are apart.
  type(tombolo_table) function table_real32(values) result(table)
    real(real32), pointer, intent(in) :: values(:, :)
    integer :: component
    if (.not. associated(values)) return
    table%is_allocated = .true.
    table%kind = FLOAT32_TYPE
    table%dimension = size(values, 1, c_int)
    table%count = size(values, 2, c_size_t)
    table%stride = storage_size(values, c_ptrdiff_t) / 8
    if (size(values) == 0) return
    do component = 1, min(9, size(values, 1))
      table%first(component) = c_loc(values(lbound(values, 1) + component - 1, lbound(values, 2)))
    end do
    if (size(values, 2) > 1) &
      table%stride = distance(table%first(1), c_loc(values(lbound(values, 1), lbound(values, 2) + 1)))
  end function

  integer(c_int) function field_real32(run, channel, name, association, values) result(status)
    type(tombolo_run), intent(in) :: run
    character(len=*), intent(in) :: channel, name
    integer(c_int), intent(in) :: association
    real(real32), pointer, intent(in) :: values(:, :)
    status = lend_field(run, channel, name, association, table_real32(values))
  end function

  integer(c_int) function components_real32(run, channel, name, association, x, y, z) result(status)
    type(tombolo_run), intent(in) :: run
    character(len=*), intent(in) :: channel, name
    integer(c_int), intent(in) :: association
    real(real32), pointer, intent(in) :: x(:)
    real(real32), pointer, intent(in), optional :: y(:), z(:)
    type(tombolo_table) :: table
    table = joined([column_real32(x), column_real32(y), column_real32(z)], FLOAT32_TYPE, channel, &
      "field '" // trim(name) // "'", status)
    if (status == TOMBOLO_OK) status = lend_field(run, channel, name, association, table)
  end function

  integer(c_int) function points_real32(run, channel, points) result(status)
    type(tombolo_run), intent(in) :: run
    character(len=*), intent(in) :: channel
    real(real32), pointer, intent(in) :: points(:, :)
    status = lend_points(run, channel, table_real32(points))
  end function

  integer(c_int) function axes_real32(run, channel, x, y, z) result(status)
    type(tombolo_run), intent(in) :: run
    character(len=*), intent(in) :: channel
    real(real32), pointer, intent(in) :: x(:), y(:)
    real(real32), pointer, intent(in), optional :: z(:)
    type(tombolo_table) :: table
    table = joined([column_real32(x), column_real32(y), column_real32(z)], FLOAT32_TYPE, channel, "points", status)
    if (status == TOMBOLO_OK) status = lend_points(run, channel, table)
  end function

  type(tombolo_column) function column_real64(values) result(column)
    real(real64), pointer, intent(in), optional :: values(:)
    type(c_ptr) :: first, next
    column%is_given = .false.
    if (.not. present(values)) return
    column%is_given = .true.
    if (.not. associated(values)) return
    first = c_null_ptr
    next = c_null_ptr
    if (size(values) > 0) first = c_loc(values(lbound(values, 1)))
    if (size(values) > 1) next = c_loc(values(lbound(values, 1) + 1))
    column = column_at(first, next, storage_size(values, c_ptrdiff_t) / 8, size(values, kind=c_size_t))
  end function

  ! Where each component of an array (components, values) begins, and how far its values are apart.
  type(tombolo_table) function table_real64(values) result(table)
    real(real64), pointer, intent(in) :: values(:, :)
    integer :: component
    if (.not. associated(values)) return
    table%is_allocated = .true.
    table%kind = FLOAT64_TYPE
    table%dimension = size(values, 1, c_int)
    table%count = size(values, 2, c_size_t)
    table%stride = storage_size(values, c_ptrdiff_t) / 8
    if (size(values) == 0) return
    do component = 1, min(9, size(values, 1))
      table%first(component) = c_loc(values(lbound(values, 1) + component - 1, lbound(values, 2)))
    end do
    if (size(values, 2) > 1) &
      table%stride = distance(table%first(1), c_loc(values(lbound(values, 1), lbound(values, 2) + 1)))
  end function

  integer(c_int) function field_real64(run, channel, name, association, values) result(status)
    type(tombolo_run), intent(in) :: run
    character(len=*), intent(in) :: channel, name
    integer(c_int), intent(in) :: association
    real(real64), pointer, intent(in) :: values(:, :)
    status = lend_field(run, channel, name, association, table_real64(values))
  end function

  integer(c_int) function components_real64(run, channel, name, association, x, y, z) result(status)
    type(tombolo_run), intent(in) :: run
    character(len=*), intent(in) :: channel, name
    integer(c_int), intent(in) :: association
    real(real64), pointer, intent(in) :: x(:)
    real(real64), pointer, intent(in), optional :: y(:), z(:)
    type(tombolo_table) :: table
    table = joined([column_real64(x), column_real64(y), column_real64(z)], FLOAT64_TYPE, channel, &
      "field '" // trim(name) // "'", status)
    if (status == TOMBOLO_OK) status = lend_field(run, channel, name, association, table)
  end function

  integer(c_int) function points_real64(run, channel, points) result(status)
    type(tombolo_run), intent(in) :: run
    character(len=*), intent(in) :: channel
    real(real64), pointer, intent(in) :: points(:, :)
    status = lend_points(run, channel, table_real64(points))
  end function

  integer(c_int) function axes_real64(run, channel, x, y, z) result(status)
    type(tombolo_run), intent(in) :: run
    character(len=*), intent(in) :: channel
    real(real64), pointer, intent(in) :: x(:), y(:)
    real(real64), pointer, intent(in), optional :: z(:)
    type(tombolo_table) :: table
    table = joined([column_real64(x), column_real64(y), column_real64(z)], FLOAT64_TYPE, channel, "points", status)
    if (status == TOMBOLO_OK) status = lend_points(run, channel, table)
  end function

  type(tombolo_column) function column_int32(values) result(column)
    integer(int32), pointer, intent(in), optional :: values(:)
    type(c_ptr) :: first, next
    column%is_given = .false.
    if (.not. present(values)) return
    column%is_given = .true.
    if (.not. associated(values)) return
    first = c_null_ptr
    next = c_null_ptr
    if (size(values) > 0) first = c_loc(values(lbound(values, 1)))
    if (size(values) > 1) next = c_loc(values(lbound(values, 1) + 1))
    column = column_at(first, next, storage_size(values, c_ptrdiff_t) / 8, size(values, kind=c_size_t))
  end function

  ! Where each component of an array (components, values) begins, and how far its values are apart.
  type(tombolo_table) function table_int32(values) result(table)
    integer(int32), pointer, intent(in) :: values(:, :)
    integer :: component
    if (.not. associated(values)) return
    table%is_allocated = .true.
    table%kind = INT32_TYPE
    table%dimension = size(values, 1, c_int)
    table%count = size(values, 2, c_size_t)
    table%stride = storage_size(values, c_ptrdiff_t) / 8
    if (size(values) == 0) return
    do component = 1, min(9, size(values, 1))
      table%first(component) = c_loc(values(lbound(values, 1) + component - 1, lbound(values, 2)))
    end do
    if (size(values, 2) > 1) &
      table%stride = distance(table%first(1), c_loc(values(lbound(values, 1), lbound(values, 2) + 1)))
  end function

  integer(c_int) function field_int32(run, channel, name, association, values) result(status)
    type(tombolo_run), intent(in) :: run
    character(len=*), intent(in) :: channel, name
    integer(c_int), intent(in) :: association
    integer(int32), pointer, intent(in) :: values(:, :)
    status = lend_field(run, channel, name, association, table_int32(values))
  end function

  integer(c_int) function components_int32(run, channel, name, association, x, y, z) result(status)
    type(tombolo_run), intent(in) :: run
    character(len=*), intent(in) :: channel, name
    integer(c_int), intent(in) :: association
    integer(int32), pointer, intent(in) :: x(:)
    integer(int32), pointer, intent(in), optional :: y(:), z(:)
    type(tombolo_table) :: table
    table = joined([column_int32(x), column_int32(y), column_int32(z)], INT32_TYPE, channel, "field '" // trim(name) // "'", status)
    if (status == TOMBOLO_OK) status = lend_field(run, channel, name, association, table)
  end function

  type(tombolo_column) function column_int64(values) result(column)
    integer(int64), pointer, intent(in), optional :: values(:)
    type(c_ptr) :: first, next
    column%is_given = .false.
    if (.not. present(values)) return
    column%is_given = .true.
    if (.not. associated(values)) return
    first = c_null_ptr
    next = c_null_ptr
    if (size(values) > 0) first = c_loc(values(lbound(values, 1)))
    if (size(values) > 1) next = c_loc(values(lbound(values, 1) + 1))
    column = column_at(first, next, storage_size(values, c_ptrdiff_t) / 8, size(values, kind=c_size_t))
  end function

  ! Where each component of an array (components, values) begins, and how far its values are apart.
  type(tombolo_table) function table_int64(values) result(table)
    integer(int64), pointer, intent(in) :: values(:, :)
    integer :: component
    if (.not. associated(values)) return
    table%is_allocated = .true.
    table%kind = INT64_TYPE
    table%dimension = size(values, 1, c_int)
    table%count = size(values, 2, c_size_t)
    table%stride = storage_size(values, c_ptrdiff_t) / 8
    if (size(values) == 0) return
    do component = 1, min(9, size(values, 1))
      table%first(component) = c_loc(values(lbound(values, 1) + component - 1, lbound(values, 2)))
    end do
    if (size(values, 2) > 1) &
      table%stride = distance(table%first(1), c_loc(values(lbound(values, 1), lbound(values, 2) + 1)))
  end function

  integer(c_int) function field_int64(run, channel, name, association, values) result(status)
    type(tombolo_run), intent(in) :: run
    character(len=*), intent(in) :: channel, name
    integer(c_int), intent(in) :: association
    integer(int64), pointer, intent(in) :: values(:, :)
    status = lend_field(run, channel, name, association, table_int64(values))
  end function

  integer(c_int) function components_int64(run, channel, name, association, x, y, z) result(status)
    type(tombolo_run), intent(in) :: run
    character(len=*), intent(in) :: channel, name
    integer(c_int), intent(in) :: association
    integer(int64), pointer, intent(in) :: x(:)
    integer(int64), pointer, intent(in), optional :: y(:), z(:)
    type(tombolo_table) :: table
    table = joined([column_int64(x), column_int64(y), column_int64(z)], INT64_TYPE, channel, "field '" // trim(name) // "'", status)
    if (status == TOMBOLO_OK) status = lend_field(run, channel, name, association, table)
  end function

  integer(c_int) function tombolo_point_cells(run, channel) result(status)
    type(tombolo_run), intent(in) :: run
    character(len=*), intent(in) :: channel
    status = c_point_cells(run%handle, c_text(channel))
  end function

  ! Forgets a field of this name, or the array "ghost_cells", "global_vertices" or "global_cells": to be called before the solver
  ! deallocates it. Without a name it forgets the whole channel.
  integer(c_int) function tombolo_forget(run, channel, name) result(status)
    type(tombolo_run), intent(in) :: run
    character(len=*), intent(in) :: channel
    character(len=*), intent(in), optional :: name
    character(kind=c_char, len=:), allocatable, target :: text
    if (present(name)) then
      text = c_text(name)
      status = c_forget(run%handle, c_text(channel), c_loc(text))
    else
      status = c_forget(run%handle, c_text(channel), c_null_ptr)
    end if
  end function

  integer(c_int) function tombolo_ghost_cells(run, channel, ghosts) result(status)
    type(tombolo_run), intent(in) :: run
    character(len=*), intent(in) :: channel
    integer(int8), pointer, intent(in) :: ghosts(:)
    if (.not. is_whole(associated(ghosts), is_contiguous(ghosts), channel, "ghost cells", status)) return
    status = c_ghost_cells(run%handle, c_text(channel), c_loc(ghosts), size(ghosts, kind=c_size_t))
  end function

  ! Whether an array is there and lies in one piece; an error where it does not.
  logical function is_whole(allocated, contiguous, channel, what, status)
    logical, intent(in) :: allocated, contiguous
    character(len=*), intent(in) :: channel, what
    integer(c_int), intent(out) :: status
    is_whole = allocated .and. contiguous
    status = TOMBOLO_OK
    if (.not. allocated) then
      status = refuse(channel, what, "an array that is not allocated", "a contiguous array")
    else if (.not. contiguous) then
      status = refuse(channel, what, "a section with gaps", "a contiguous array")
    end if
  end function

  ! Whether each of the cells has the vertices that its type has; an error where they do not.
  logical function fits(cell_type, vertices, channel, what, status)
    integer(c_int), intent(in) :: cell_type
    integer, intent(in) :: vertices
    character(len=*), intent(in) :: channel, what
    integer(c_int), intent(out) :: status
    integer(c_int) :: expected
    expected = c_vertices_of_cell(cell_type)
    status = TOMBOLO_OK
    ! Of a type that is not known the call itself tells.
    fits = expected == 0 .or. expected == vertices
    if (.not. fits) status = refuse(channel, what, "an array with " // text_of(int(vertices, c_size_t)) // " rows", &
      text_of(int(expected, c_size_t)) // ", the vertices of each along the first dimension")
  end function

  integer(c_int) function cells_int32(run, channel, cell_type, connectivity) result(status)
    type(tombolo_run), intent(in) :: run
    character(len=*), intent(in) :: channel
    integer(c_int), intent(in) :: cell_type
    integer(int32), pointer, intent(in) :: connectivity(:, :)
    if (.not. is_whole(associated(connectivity), is_contiguous(connectivity), channel, "cells", status)) return
    if (.not. fits(cell_type, size(connectivity, 1), channel, "cells", status)) return
    status = c_cells_i32(run%handle, c_text(channel), cell_type, c_loc(connectivity), size(connectivity, 2, c_size_t))
  end function

  integer(c_int) function mixed_cells_int32(run, channel, cell_types, sizes, connectivity) result(status)
    type(tombolo_run), intent(in) :: run
    character(len=*), intent(in) :: channel
    integer(int8), pointer, intent(in) :: cell_types(:)
    integer(int32), pointer, intent(in) :: sizes(:), connectivity(:)
    if (.not. is_whole(associated(cell_types), is_contiguous(cell_types), channel, "cell types", status)) return
    if (.not. is_whole(associated(sizes), is_contiguous(sizes), channel, "sizes of cells", status)) return
    if (.not. is_whole(associated(connectivity), is_contiguous(connectivity), channel, "cells", status)) return
    if (size(cell_types) /= size(sizes)) then
      status = refuse(channel, "cell types", text_of(size(cell_types, kind=c_size_t)) // " types", &
        text_of(size(sizes, kind=c_size_t)) // ", as many as sizes")
      return
    end if
    status = c_mixed_cells_i32(run%handle, c_text(channel), c_loc(cell_types), c_loc(sizes), size(sizes, kind=c_size_t), &
      c_loc(connectivity), size(connectivity, kind=c_size_t))
  end function

  integer(c_int) function faces_int32(run, channel, face_type, connectivity, features) result(status)
    type(tombolo_run), intent(in) :: run
    character(len=*), intent(in) :: channel
    integer(c_int), intent(in) :: face_type
    integer(int32), pointer, intent(in) :: connectivity(:, :), features(:)
    if (.not. is_whole(associated(connectivity), is_contiguous(connectivity), channel, "faces", status)) return
    if (.not. is_whole(associated(features), is_contiguous(features), channel, "faces, features", status)) return
    if (.not. fits(face_type, size(connectivity, 1), channel, "faces", status)) return
    if (size(features) /= size(connectivity, 2)) then
      status = refuse(channel, "faces, features", text_of(size(features, kind=c_size_t)) // " numbers", &
        text_of(size(connectivity, 2, c_size_t)) // ", one for each face")
      return
    end if
    status = c_faces_i32(run%handle, c_text(channel), face_type, c_loc(connectivity), c_loc(features), &
      size(features, kind=c_size_t))
  end function

  integer(c_int) function feature_int32(run, channel, number, name) result(status)
    type(tombolo_run), intent(in) :: run
    character(len=*), intent(in) :: channel, name
    integer(int32), intent(in) :: number
    status = c_feature(run%handle, c_text(channel), int(number, c_int64_t), c_text(name))
  end function

  integer(c_int) function global_vertices_int32(run, channel, numbers) result(status)
    type(tombolo_run), intent(in) :: run
    character(len=*), intent(in) :: channel
    integer(int32), pointer, intent(in) :: numbers(:)
    if (.not. is_whole(associated(numbers), is_contiguous(numbers), channel, "global vertices", status)) return
    status = c_global_vertices_i32(run%handle, c_text(channel), c_loc(numbers), size(numbers, kind=c_size_t))
  end function

  integer(c_int) function global_cells_int32(run, channel, numbers) result(status)
    type(tombolo_run), intent(in) :: run
    character(len=*), intent(in) :: channel
    integer(int32), pointer, intent(in) :: numbers(:)
    if (.not. is_whole(associated(numbers), is_contiguous(numbers), channel, "global cells", status)) return
    status = c_global_cells_i32(run%handle, c_text(channel), c_loc(numbers), size(numbers, kind=c_size_t))
  end function

  ! A negative cycle, which C does not have, is refused by the library: on all ranks.
  integer(c_int) function execute_cycle(run, cycle, time, time_step) result(status)
    type(tombolo_run), intent(in) :: run
    integer(c_int64_t), intent(in) :: cycle
    real(c_double), intent(in) :: time, time_step
    status = c_execute(run%handle, cycle, time, time_step)
  end function

  integer(c_int) function execute_int32(run, cycle, time, time_step) result(status)
    type(tombolo_run), intent(in) :: run
    integer(int32), intent(in) :: cycle
    real(c_double), intent(in) :: time, time_step
    status = execute_cycle(run, int(cycle, c_int64_t), time, time_step)
  end function

  integer(c_int) function cells_int64(run, channel, cell_type, connectivity) result(status)
    type(tombolo_run), intent(in) :: run
    character(len=*), intent(in) :: channel
    integer(c_int), intent(in) :: cell_type
    integer(int64), pointer, intent(in) :: connectivity(:, :)
    if (.not. is_whole(associated(connectivity), is_contiguous(connectivity), channel, "cells", status)) return
    if (.not. fits(cell_type, size(connectivity, 1), channel, "cells", status)) return
    status = c_cells_i64(run%handle, c_text(channel), cell_type, c_loc(connectivity), size(connectivity, 2, c_size_t))
  end function

  integer(c_int) function mixed_cells_int64(run, channel, cell_types, sizes, connectivity) result(status)
    type(tombolo_run), intent(in) :: run
    character(len=*), intent(in) :: channel
    integer(int8), pointer, intent(in) :: cell_types(:)
    integer(int64), pointer, intent(in) :: sizes(:), connectivity(:)
    if (.not. is_whole(associated(cell_types), is_contiguous(cell_types), channel, "cell types", status)) return
    if (.not. is_whole(associated(sizes), is_contiguous(sizes), channel, "sizes of cells", status)) return
    if (.not. is_whole(associated(connectivity), is_contiguous(connectivity), channel, "cells", status)) return
    if (size(cell_types) /= size(sizes)) then
      status = refuse(channel, "cell types", text_of(size(cell_types, kind=c_size_t)) // " types", &
        text_of(size(sizes, kind=c_size_t)) // ", as many as sizes")
      return
    end if
    status = c_mixed_cells_i64(run%handle, c_text(channel), c_loc(cell_types), c_loc(sizes), size(sizes, kind=c_size_t), &
      c_loc(connectivity), size(connectivity, kind=c_size_t))
  end function

  integer(c_int) function faces_int64(run, channel, face_type, connectivity, features) result(status)
    type(tombolo_run), intent(in) :: run
    character(len=*), intent(in) :: channel
    integer(c_int), intent(in) :: face_type
    integer(int64), pointer, intent(in) :: connectivity(:, :), features(:)
    if (.not. is_whole(associated(connectivity), is_contiguous(connectivity), channel, "faces", status)) return
    if (.not. is_whole(associated(features), is_contiguous(features), channel, "faces, features", status)) return
    if (.not. fits(face_type, size(connectivity, 1), channel, "faces", status)) return
    if (size(features) /= size(connectivity, 2)) then
      status = refuse(channel, "faces, features", text_of(size(features, kind=c_size_t)) // " numbers", &
        text_of(size(connectivity, 2, c_size_t)) // ", one for each face")
      return
    end if
    status = c_faces_i64(run%handle, c_text(channel), face_type, c_loc(connectivity), c_loc(features), &
      size(features, kind=c_size_t))
  end function

  integer(c_int) function feature_int64(run, channel, number, name) result(status)
    type(tombolo_run), intent(in) :: run
    character(len=*), intent(in) :: channel, name
    integer(int64), intent(in) :: number
    status = c_feature(run%handle, c_text(channel), int(number, c_int64_t), c_text(name))
  end function

  integer(c_int) function global_vertices_int64(run, channel, numbers) result(status)
    type(tombolo_run), intent(in) :: run
    character(len=*), intent(in) :: channel
    integer(int64), pointer, intent(in) :: numbers(:)
    if (.not. is_whole(associated(numbers), is_contiguous(numbers), channel, "global vertices", status)) return
    status = c_global_vertices_i64(run%handle, c_text(channel), c_loc(numbers), size(numbers, kind=c_size_t))
  end function

  integer(c_int) function global_cells_int64(run, channel, numbers) result(status)
    type(tombolo_run), intent(in) :: run
    character(len=*), intent(in) :: channel
    integer(int64), pointer, intent(in) :: numbers(:)
    if (.not. is_whole(associated(numbers), is_contiguous(numbers), channel, "global cells", status)) return
    status = c_global_cells_i64(run%handle, c_text(channel), c_loc(numbers), size(numbers, kind=c_size_t))
  end function

  integer(c_int) function execute_int64(run, cycle, time, time_step) result(status)
    type(tombolo_run), intent(in) :: run
    integer(int64), intent(in) :: cycle
    real(c_double), intent(in) :: time, time_step
    status = execute_cycle(run, int(cycle, c_int64_t), time, time_step)
  end function

  ! Where the vertices are to be, (3, vertices); not associated where the mesh stays.
  function tombolo_coordinates(run) result(values)
    type(tombolo_run), intent(in) :: run
    real(c_double), pointer :: values(:, :)
    values => vectors(c_coordinates(run%handle), c_motion_count(run%handle))
  end function

  function tombolo_displacement(run) result(values)
    type(tombolo_run), intent(in) :: run
    real(c_double), pointer :: values(:, :)
    values => vectors(c_displacement(run%handle), c_motion_count(run%handle))
  end function

  function tombolo_velocity(run) result(values)
    type(tombolo_run), intent(in) :: run
    real(c_double), pointer :: values(:, :)
    values => vectors(c_velocity(run%handle), c_motion_count(run%handle))
  end function

  ! The vertices of the boundary, counted from 0 as those of cells are; not associated where the mesh stays.
  function tombolo_surface_vertices(run) result(values)
    type(tombolo_run), intent(in) :: run
    integer(int32), pointer :: values(:)
    type(c_ptr) :: first
    nullify (values)
    first = c_surface_vertices(run%handle)
    if (c_associated(first)) call c_f_pointer(first, values, [c_surface_count(run%handle)])
  end function

  function tombolo_surface_coordinates(run) result(values)
    type(tombolo_run), intent(in) :: run
    real(c_double), pointer :: values(:, :)
    values => vectors(c_surface_coordinates(run%handle), c_surface_count(run%handle))
  end function

  function tombolo_surface_displacement(run) result(values)
    type(tombolo_run), intent(in) :: run
    real(c_double), pointer :: values(:, :)
    values => vectors(c_surface_displacement(run%handle), c_surface_count(run%handle))
  end function

  function tombolo_surface_velocity(run) result(values)
    type(tombolo_run), intent(in) :: run
    real(c_double), pointer :: values(:, :)
    values => vectors(c_surface_velocity(run%handle), c_surface_count(run%handle))
  end function

  function vectors(first, count) result(values)
    type(c_ptr), intent(in) :: first
    integer(c_size_t), intent(in) :: count
    real(c_double), pointer :: values(:, :)
    nullify (values)
    if (c_associated(first)) call c_f_pointer(first, values, [3_c_size_t, count])
  end function

  integer(c_int) function tombolo_motion_shape(run, shape, shapes) result(status)
    type(tombolo_run), intent(in) :: run
    integer(c_int), intent(out) :: shape, shapes
    status = c_motion_shape(run%handle, shape, shapes)
  end function

  integer(c_int) function tombolo_parameter_value(run, name, value) result(status)
    type(tombolo_run), intent(in) :: run
    character(len=*), intent(in) :: name
    real(c_double), intent(inout) :: value
    status = c_parameter_value(run%handle, c_text(name), value)
  end function

  integer(c_int) function tombolo_release_shape(run, reason) result(status)
    type(tombolo_run), intent(in) :: run
    character(len=*), intent(in) :: reason
    status = c_release_shape(run%handle, c_text(reason))
  end function

  ! Asks the run to end, from any thread.
  integer(c_int) function tombolo_stop(run) result(status)
    type(tombolo_run), intent(in) :: run
    status = c_stop(run%handle)
  end function

  ! Whether a tombolo_execute has said that the run is to end, on all ranks alike; not before the first.
  logical function tombolo_stopped(run)
    type(tombolo_run), intent(in) :: run
    tombolo_stopped = c_stopped(run%handle) /= 0
  end function

  integer function tombolo_order_count(run)
    type(tombolo_run), intent(in) :: run
    tombolo_order_count = int(c_order_count(run%handle))
  end function

  ! What became of an order, counted from 1.
  function tombolo_order(run, number) result(text)
    type(tombolo_run), intent(in) :: run
    integer, intent(in) :: number
    character(len=:), allocatable :: text
    text = from_c(c_order_by_number(run%handle, int(number, c_int64_t)))
  end function
end module tombolo
