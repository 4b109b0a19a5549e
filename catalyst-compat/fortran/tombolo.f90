! Tombolo for solvers in Fortran: the interface of tombolo.h. What each function does, and what its arguments mean, is told there;
! a status other than TOMBOLO_OK is explained by tombolo_message().
!
! Texts are trimmed of blanks at their end. Arrays are borrowed, not copied: they need the attribute `target` and must stay where they
! are while tombolo_execute runs.
module tombolo
  use, intrinsic :: iso_c_binding
  implicit none
  private

  integer(c_int), parameter, public :: TOMBOLO_OK = 0, TOMBOLO_WRONG_CALL = 1, TOMBOLO_INVALID = 100, TOMBOLO_FAILED = 102
  integer(c_int), parameter, public :: TOMBOLO_INT32 = 5, TOMBOLO_INT64 = 6, TOMBOLO_FLOAT32 = 11, TOMBOLO_FLOAT64 = 12
  integer(c_int), parameter, public :: TOMBOLO_VERTEX = 0, TOMBOLO_ELEMENT = 1
  integer(c_int), parameter, public :: TOMBOLO_POINT = 1, TOMBOLO_LINE = 3, TOMBOLO_TRIANGLE = 5, TOMBOLO_QUAD = 9, &
    TOMBOLO_TETRA = 10, TOMBOLO_HEXAHEDRON = 12, TOMBOLO_WEDGE = 13, TOMBOLO_PYRAMID = 14

  public :: tombolo_create, tombolo_destroy, tombolo_initialize, tombolo_finalize, tombolo_execute, tombolo_stopped
  public :: tombolo_communicator, tombolo_order_count
  public :: tombolo_message, tombolo_configure, tombolo_configure_file, tombolo_orders_file, tombolo_output
  public :: tombolo_parameter, tombolo_parameter_value, tombolo_link, tombolo_mesh, tombolo_cells, tombolo_mixed_cells
  public :: tombolo_faces, tombolo_feature, tombolo_global_numbers, tombolo_ghosts, tombolo_field
  public :: tombolo_coordinates, tombolo_displacement, tombolo_velocity, tombolo_schedule, tombolo_order, tombolo_report

  interface
    function tombolo_create() bind(C) result(run)
      import :: c_ptr
      type(c_ptr) :: run
    end function
    subroutine tombolo_destroy(run) bind(C)
      import :: c_ptr
      type(c_ptr), value :: run
    end subroutine
    function tombolo_initialize(run) bind(C) result(status)
      import :: c_ptr, c_int
      type(c_ptr), value :: run
      integer(c_int) :: status
    end function
    function tombolo_finalize(run) bind(C) result(status)
      import :: c_ptr, c_int
      type(c_ptr), value :: run
      integer(c_int) :: status
    end function
    function tombolo_execute(run, cycle, time, time_step) bind(C) result(status)
      import :: c_ptr, c_int, c_int64_t, c_double
      type(c_ptr), value :: run
      integer(c_int64_t), value :: cycle
      real(c_double), value :: time, time_step
      integer(c_int) :: status
    end function
    function tombolo_stopped(run) bind(C) result(stopped)
      import :: c_ptr, c_int
      type(c_ptr), value :: run
      integer(c_int) :: stopped
    end function
    ! The handle of the communicator as Fortran has it.
    function tombolo_communicator(run, communicator) bind(C) result(status)
      import :: c_ptr, c_int
      type(c_ptr), value :: run
      integer(c_int), value :: communicator
      integer(c_int) :: status
    end function
    function tombolo_order_count(run) bind(C) result(count)
      import :: c_ptr, c_size_t
      type(c_ptr), value :: run
      integer(c_size_t) :: count
    end function
  end interface

  ! The same functions with C's texts.
  interface
    function c_message() bind(C, name="tombolo_message") result(text)
      import :: c_ptr
      type(c_ptr) :: text
    end function
    function c_report(run) bind(C, name="tombolo_report") result(text)
      import :: c_ptr
      type(c_ptr), value :: run
      type(c_ptr) :: text
    end function
    function c_configure(run, json) bind(C, name="tombolo_configure") result(status)
      import :: c_ptr, c_int, c_char
      type(c_ptr), value :: run
      character(kind=c_char), intent(in) :: json(*)
      integer(c_int) :: status
    end function
    function c_configure_file(run, file) bind(C, name="tombolo_configure_file") result(status)
      import :: c_ptr, c_int, c_char
      type(c_ptr), value :: run
      character(kind=c_char), intent(in) :: file(*)
      integer(c_int) :: status
    end function
    function c_orders_file(run, file) bind(C, name="tombolo_orders_file") result(status)
      import :: c_ptr, c_int, c_char
      type(c_ptr), value :: run
      character(kind=c_char), intent(in) :: file(*)
      integer(c_int) :: status
    end function
    function c_output(run, directory) bind(C, name="tombolo_output") result(status)
      import :: c_ptr, c_int, c_char
      type(c_ptr), value :: run
      character(kind=c_char), intent(in) :: directory(*)
      integer(c_int) :: status
    end function
    function c_parameter(run, name, value, minimum, maximum) bind(C, name="tombolo_parameter") result(status)
      import :: c_ptr, c_int, c_char, c_double
      type(c_ptr), value :: run
      character(kind=c_char), intent(in) :: name(*)
      real(c_double), value :: value, minimum, maximum
      integer(c_int) :: status
    end function
    function c_parameter_value(run, name, value) bind(C, name="tombolo_parameter_value") result(status)
      import :: c_ptr, c_int, c_char, c_double
      type(c_ptr), value :: run
      character(kind=c_char), intent(in) :: name(*)
      real(c_double), intent(inout) :: value
      integer(c_int) :: status
    end function
    function c_link(run, text, bytes) bind(C, name="tombolo_link") result(status)
      import :: c_ptr, c_int, c_char, c_size_t
      type(c_ptr), value :: run
      character(kind=c_char), intent(out) :: text(*)
      integer(c_size_t), value :: bytes
      integer(c_int) :: status
    end function
    function c_mesh(run, channel, kind, coordinates, vertices, dimension, stride) bind(C, name="tombolo_mesh") result(status)
      import :: c_ptr, c_int, c_char, c_size_t
      type(c_ptr), value :: run, coordinates
      character(kind=c_char), intent(in) :: channel(*)
      integer(c_int), value :: kind, dimension
      integer(c_size_t), value :: vertices, stride
      integer(c_int) :: status
    end function
    function c_cells(run, channel, cell, kind, connectivity, cells) bind(C, name="tombolo_cells") result(status)
      import :: c_ptr, c_int, c_char, c_size_t
      type(c_ptr), value :: run, connectivity
      character(kind=c_char), intent(in) :: channel(*)
      integer(c_int), value :: cell, kind
      integer(c_size_t), value :: cells
      integer(c_int) :: status
    end function
    function c_mixed_cells(run, channel, cell_types, kind, sizes, cells, connectivity, length) &
        bind(C, name="tombolo_mixed_cells") result(status)
      import :: c_ptr, c_int, c_char, c_size_t
      type(c_ptr), value :: run, cell_types, sizes, connectivity
      character(kind=c_char), intent(in) :: channel(*)
      integer(c_int), value :: kind
      integer(c_size_t), value :: cells, length
      integer(c_int) :: status
    end function
    function c_faces(run, channel, cell, kind, connectivity, features, faces) bind(C, name="tombolo_faces") result(status)
      import :: c_ptr, c_int, c_char, c_size_t
      type(c_ptr), value :: run, connectivity, features
      character(kind=c_char), intent(in) :: channel(*)
      integer(c_int), value :: cell, kind
      integer(c_size_t), value :: faces
      integer(c_int) :: status
    end function
    function c_feature(run, channel, number, name) bind(C, name="tombolo_feature") result(status)
      import :: c_ptr, c_int, c_char, c_int64_t
      type(c_ptr), value :: run
      character(kind=c_char), intent(in) :: channel(*), name(*)
      integer(c_int64_t), value :: number
      integer(c_int) :: status
    end function
    function c_global_numbers(run, channel, kind, vertices, cells) bind(C, name="tombolo_global_numbers") result(status)
      import :: c_ptr, c_int, c_char
      type(c_ptr), value :: run, vertices, cells
      character(kind=c_char), intent(in) :: channel(*)
      integer(c_int), value :: kind
      integer(c_int) :: status
    end function
    function c_ghosts(run, channel, ghosts) bind(C, name="tombolo_ghosts") result(status)
      import :: c_ptr, c_int, c_char
      type(c_ptr), value :: run, ghosts
      character(kind=c_char), intent(in) :: channel(*)
      integer(c_int) :: status
    end function
    function c_field(run, channel, name, association, kind, values, components, stride) &
        bind(C, name="tombolo_field") result(status)
      import :: c_ptr, c_int, c_char, c_size_t
      type(c_ptr), value :: run, values
      character(kind=c_char), intent(in) :: channel(*), name(*)
      integer(c_int), value :: association, kind, components
      integer(c_size_t), value :: stride
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
    function c_schedule(run, shape, shapes, order, bytes) bind(C, name="tombolo_schedule") result(status)
      import :: c_ptr, c_int, c_char, c_size_t
      type(c_ptr), value :: run
      integer(c_int), intent(out) :: shape, shapes
      character(kind=c_char), intent(out) :: order(*)
      integer(c_size_t), value :: bytes
      integer(c_int) :: status
    end function
    function c_order(run, index, json, bytes) bind(C, name="tombolo_order") result(status)
      import :: c_ptr, c_int, c_char, c_size_t
      type(c_ptr), value :: run
      integer(c_size_t), value :: index, bytes
      character(kind=c_char), intent(out) :: json(*)
      integer(c_int) :: status
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

  ! A text that C has written: blanks from its end on.
  subroutine blank_rest(text)
    character(len=*), intent(inout) :: text
    integer :: last
    last = index(text, c_null_char)
    if (last > 0) text(last:) = " "
  end subroutine

  function tombolo_message() result(text)
    character(len=:), allocatable :: text
    text = from_c(c_message())
  end function

  function tombolo_report(run) result(text)
    type(c_ptr), intent(in) :: run
    character(len=:), allocatable :: text
    text = from_c(c_report(run))
  end function

  integer(c_int) function tombolo_configure(run, json) result(status)
    type(c_ptr), intent(in) :: run
    character(len=*), intent(in) :: json
    status = c_configure(run, c_text(json))
  end function

  integer(c_int) function tombolo_configure_file(run, file) result(status)
    type(c_ptr), intent(in) :: run
    character(len=*), intent(in) :: file
    status = c_configure_file(run, c_text(file))
  end function

  integer(c_int) function tombolo_orders_file(run, file) result(status)
    type(c_ptr), intent(in) :: run
    character(len=*), intent(in) :: file
    status = c_orders_file(run, c_text(file))
  end function

  integer(c_int) function tombolo_output(run, directory) result(status)
    type(c_ptr), intent(in) :: run
    character(len=*), intent(in) :: directory
    status = c_output(run, c_text(directory))
  end function

  integer(c_int) function tombolo_parameter(run, name, value, minimum, maximum) result(status)
    type(c_ptr), intent(in) :: run
    character(len=*), intent(in) :: name
    real(c_double), intent(in) :: value, minimum, maximum
    status = c_parameter(run, c_text(name), value, minimum, maximum)
  end function

  integer(c_int) function tombolo_parameter_value(run, name, value) result(status)
    type(c_ptr), intent(in) :: run
    character(len=*), intent(in) :: name
    real(c_double), intent(inout) :: value
    status = c_parameter_value(run, c_text(name), value)
  end function

  integer(c_int) function tombolo_link(run, text) result(status)
    type(c_ptr), intent(in) :: run
    character(len=*), intent(out) :: text
    text = c_null_char
    status = c_link(run, text, len(text, c_size_t))
    call blank_rest(text)
  end function

  ! Coordinates in double precision, (dimension, vertices).
  integer(c_int) function tombolo_mesh(run, channel, coordinates) result(status)
    type(c_ptr), intent(in) :: run
    character(len=*), intent(in) :: channel
    real(c_double), intent(in), target, contiguous :: coordinates(:, :)
    integer(c_size_t) :: each
    each = size(coordinates, 1)
    status = c_mesh(run, c_text(channel), TOMBOLO_FLOAT64, c_loc(coordinates), size(coordinates, 2, c_size_t), int(each, c_int), each)
  end function

  ! Vertices from 0 on, (corners, cells).
  integer(c_int) function tombolo_cells(run, channel, cell, connectivity) result(status)
    type(c_ptr), intent(in) :: run
    character(len=*), intent(in) :: channel
    integer(c_int), intent(in) :: cell
    integer(c_int32_t), intent(in), target, contiguous :: connectivity(:, :)
    status = c_cells(run, c_text(channel), cell, TOMBOLO_INT32, c_loc(connectivity), size(connectivity, 2, c_size_t))
  end function

  integer(c_int) function tombolo_mixed_cells(run, channel, cell_types, sizes, connectivity) result(status)
    type(c_ptr), intent(in) :: run
    character(len=*), intent(in) :: channel
    integer(c_int8_t), intent(in), target, contiguous :: cell_types(:)
    integer(c_int32_t), intent(in), target, contiguous :: sizes(:), connectivity(:)
    status = c_mixed_cells(run, c_text(channel), c_loc(cell_types), TOMBOLO_INT32, c_loc(sizes), size(sizes, kind=c_size_t), &
      c_loc(connectivity), size(connectivity, kind=c_size_t))
  end function

  ! Vertices of faces from 0 on, (corners, faces), and the number of each face's feature.
  integer(c_int) function tombolo_faces(run, channel, cell, connectivity, features) result(status)
    type(c_ptr), intent(in) :: run
    character(len=*), intent(in) :: channel
    integer(c_int), intent(in) :: cell
    integer(c_int32_t), intent(in), target, contiguous :: connectivity(:, :), features(:)
    status = c_faces(run, c_text(channel), cell, TOMBOLO_INT32, c_loc(connectivity), c_loc(features), size(features, kind=c_size_t))
  end function

  integer(c_int) function tombolo_feature(run, channel, number, name) result(status)
    type(c_ptr), intent(in) :: run
    character(len=*), intent(in) :: channel, name
    integer, intent(in) :: number
    status = c_feature(run, c_text(channel), int(number, c_int64_t), c_text(name))
  end function

  ! Of vertices; of cells too where they are known.
  integer(c_int) function tombolo_global_numbers(run, channel, vertices, cells) result(status)
    type(c_ptr), intent(in) :: run
    character(len=*), intent(in) :: channel
    integer(c_int64_t), intent(in), target, contiguous :: vertices(:)
    integer(c_int64_t), intent(in), optional, target, contiguous :: cells(:)
    type(c_ptr) :: of_cells
    of_cells = c_null_ptr
    if (present(cells)) of_cells = c_loc(cells)
    status = c_global_numbers(run, c_text(channel), TOMBOLO_INT64, c_loc(vertices), of_cells)
  end function

  integer(c_int) function tombolo_ghosts(run, channel, ghosts) result(status)
    type(c_ptr), intent(in) :: run
    character(len=*), intent(in) :: channel
    integer(c_int8_t), intent(in), target, contiguous :: ghosts(:)
    status = c_ghosts(run, c_text(channel), c_loc(ghosts))
  end function

  ! Values in double precision, (components, vertices or cells); for one component reshape by a pointer: values(1:1, 1:n) => array.
  integer(c_int) function tombolo_field(run, channel, name, association, values) result(status)
    type(c_ptr), intent(in) :: run
    character(len=*), intent(in) :: channel, name
    integer(c_int), intent(in) :: association
    real(c_double), intent(in), target, contiguous :: values(:, :)
    integer(c_size_t) :: each
    each = size(values, 1)
    status = c_field(run, c_text(channel), c_text(name), association, TOMBOLO_FLOAT64, c_loc(values), int(each, c_int), each)
  end function

  ! Where the `vertices` vertices are to be, (3, vertices); not associated where the mesh stays.
  function tombolo_coordinates(run, vertices) result(values)
    type(c_ptr), intent(in) :: run
    integer, intent(in) :: vertices
    real(c_double), pointer :: values(:, :)
    values => vectors(c_coordinates(run), vertices)
  end function

  function tombolo_displacement(run, vertices) result(values)
    type(c_ptr), intent(in) :: run
    integer, intent(in) :: vertices
    real(c_double), pointer :: values(:, :)
    values => vectors(c_displacement(run), vertices)
  end function

  function tombolo_velocity(run, vertices) result(values)
    type(c_ptr), intent(in) :: run
    integer, intent(in) :: vertices
    real(c_double), pointer :: values(:, :)
    values => vectors(c_velocity(run), vertices)
  end function

  function vectors(first, vertices) result(values)
    type(c_ptr), intent(in) :: first
    integer, intent(in) :: vertices
    real(c_double), pointer :: values(:, :)
    nullify (values)
    if (c_associated(first)) call c_f_pointer(first, values, [3, vertices])
  end function

  integer(c_int) function tombolo_schedule(run, shape, shapes, order) result(status)
    type(c_ptr), intent(in) :: run
    integer(c_int), intent(out) :: shape, shapes
    character(len=*), intent(out) :: order
    order = c_null_char
    status = c_schedule(run, shape, shapes, order, len(order, c_size_t))
    call blank_rest(order)
  end function

  ! Orders are counted from 0.
  integer(c_int) function tombolo_order(run, index_of_order, json) result(status)
    type(c_ptr), intent(in) :: run
    integer(c_size_t), intent(in) :: index_of_order
    character(len=*), intent(out) :: json
    json = c_null_char
    status = c_order(run, index_of_order, json, len(json, c_size_t))
    call blank_rest(json)
  end function
end module tombolo
