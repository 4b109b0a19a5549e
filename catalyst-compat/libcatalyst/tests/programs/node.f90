! Nodes and a session of Catalyst from Fortran.
program node
  use, intrinsic :: iso_c_binding
  use catalyst_api
  use catalyst_conduit
  implicit none

  type(c_ptr) :: tree, mesh, place, other, info
  real(8), target :: x(4), y(4), pairs(2, 4)
  integer(4) :: connectivity(4)
  integer(4), pointer :: integers(:)
  real(8), pointer :: reals(:)
  character(len=32) :: text
  character(len=16) :: padded
  character, pointer :: letters(:)
  integer(kind(catalyst_status)) :: code
  integer :: i

  x = (/ 0d0, 1d0, 0d0, 1d0 /)
  y = (/ 0d0, 0d0, 1d0, 1d0 /)
  connectivity = (/ 0, 1, 3, 2 /)
  do i = 1, 4
    pairs(:, i) = (/ 10d0 * i, 10d0 * i + 1 /)
  end do

  tree = catalyst_conduit_node_create()
  call check(logical(catalyst_conduit_node_is_root(tree)), 1)
  call catalyst_conduit_node_set_path_int32(tree, "catalyst/state/timestep  ", 7)
  call catalyst_conduit_node_set_path_float64(tree, "catalyst/state/time", 0.5d0)
  call catalyst_conduit_node_set_path_char8_str(tree, "catalyst/channels/grid/type", "mesh")
  mesh = catalyst_conduit_node_fetch(tree, "catalyst/channels/grid/data")
  call catalyst_conduit_node_set_path_char8_str(mesh, "coordsets/coords/type", "explicit")
  call catalyst_conduit_node_set_path_external_float64_ptr(mesh, "coordsets/coords/values/x", x, 4_8)
  call catalyst_conduit_node_set_path_external_float64_ptr(mesh, "coordsets/coords/values/y", y, 4_8)
  call catalyst_conduit_node_set_path_char8_str(mesh, "topologies/mesh/type", "unstructured")
  call catalyst_conduit_node_set_path_char8_str(mesh, "topologies/mesh/coordset", "coords")
  call catalyst_conduit_node_set_path_char8_str(mesh, "topologies/mesh/elements/shape", "quad")
  call catalyst_conduit_node_set_path_int32_ptr(mesh, "topologies/mesh/elements/connectivity", connectivity, 4_8)
  call catalyst_conduit_node_set_path_char8_str(mesh, "fields/f/association", "vertex")
  call catalyst_conduit_node_set_path_char8_str(mesh, "fields/f/topology", "mesh")
  call catalyst_conduit_node_set_path_external_float64_ptr_detailed(mesh, "fields/f/values", pairs, 4_8, 8_8, 16_8, 8_8, 0_8)

  info = catalyst_conduit_node_create()
  call check(logical(catalyst_conduit_blueprint_verify("mesh", mesh, info)), 2)
  call check(logical(catalyst_conduit_node_has_path(mesh, "fields/f/values")), 3)
  call check(.not. logical(catalyst_conduit_node_has_path(mesh, "fields/g")), 4)
  call check(catalyst_conduit_node_fetch_path_as_int32(tree, "catalyst/state/timestep") == 7, 5)
  call check(catalyst_conduit_node_fetch_path_as_float64(mesh, "fields/f/values") == 11d0, 6)

  call catalyst_conduit_node_fetch_path_as_int32_ptr(mesh, "topologies/mesh/elements/connectivity", integers)
  call check(size(integers) == 4 .and. integers(3) == 3, 7)
  call catalyst_conduit_node_fetch_path_as_float64_ptr(mesh, "coordsets/coords/values/x", reals)
  reals(2) = 2d0
  call check(x(2) == 2d0, 8)
  call catalyst_conduit_node_fetch_path_as_char8_str(mesh, "fields/f/association", text)
  call check(text == "vertex", 9)
  padded = "blanks"
  call catalyst_conduit_node_set_path_char8_str(tree, "padded", padded)
  call catalyst_conduit_node_fetch_path_as_char8_str(tree, "padded", letters)
  call check(size(letters) == 7 .and. letters(6) == "s" .and. letters(7) == C_NULL_CHAR, 20)
  call catalyst_conduit_node_set_char8_str(catalyst_conduit_node_fetch(tree, "padded"), "more  ")
  call catalyst_conduit_node_as_char8_str(catalyst_conduit_node_fetch(tree, "padded"), letters)
  call check(size(letters) == 5, 21)
  call catalyst_conduit_node_path(catalyst_conduit_node_fetch(mesh, "fields/f"), text)
  call check(text == "catalyst/channels/grid/data/fiel", 10)

  other = catalyst_conduit_node_create()
  place = catalyst_conduit_node_append(other)
  call catalyst_conduit_node_set_int(place, 42)
  call check(catalyst_conduit_node_number_of_children(other) == 1_8, 11)
  call check(catalyst_conduit_node_as_int(catalyst_conduit_node_child(other, 0_8)) == 42, 12)
  call catalyst_conduit_node_set_path_node(tree, "list", other)
  call check(.not. logical(catalyst_conduit_node_diff(other, catalyst_conduit_node_fetch(tree, "list"), info, 1d-12)), 13)
  call check(catalyst_conduit_datatype_id(catalyst_conduit_node_dtype(place)) == CATALYST_CONDUIT_INT32_ID, 14)

  code = c_catalyst_initialize(tree)
  call check(code == catalyst_status_ok, 15)
  call check(c_catalyst_execute(tree) == catalyst_status_ok, 16)
  call check(c_catalyst_results(info) == catalyst_status_ok, 17)
  call check(c_catalyst_about(info) == catalyst_status_ok, 18)
  call catalyst_conduit_node_fetch_path_as_char8_str(info, "catalyst/implementation", text)
  call check(c_catalyst_finalize(tree) == catalyst_status_ok, 19)
  call catalyst_conduit_node_destroy(tree)
  call catalyst_conduit_node_destroy(other)
  call catalyst_conduit_node_destroy(info)
  print '(a)', 'node.f90: ok with ' // trim(text)

contains

  subroutine check(holds, number)
    logical, intent(in) :: holds
    integer, intent(in) :: number
    if (.not. holds) then
      print '(a, i0)', 'node.f90: not as expected: check ', number
      stop 1
    end if
  end subroutine
end program node
