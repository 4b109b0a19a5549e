! The five calls of Catalyst.
module catalyst_api
  use, intrinsic :: iso_c_binding, only: c_int, c_ptr
  implicit none
  private :: c_int, c_ptr

  enum, bind(c)
    ! For declarations: integer(kind(catalyst_status)).
    enumerator :: catalyst_status = 0

    enumerator :: catalyst_status_ok = 0
    enumerator :: catalyst_status_error_no_implementation = 1
    enumerator :: catalyst_status_error_already_loaded = 2
    enumerator :: catalyst_status_error_not_found = 3
    enumerator :: catalyst_status_error_not_catalyst = 4
    enumerator :: catalyst_status_error_incomplete = 5
    enumerator :: catalyst_status_error_unsupported_version = 6
    enumerator :: catalyst_status_error_conduit_mismatch = 7
  end enum

  interface
    function c_catalyst_initialize(cnode) result(catalyst_code) bind(C, name="catalyst_initialize")
      import :: c_int, c_ptr
      type(c_ptr), value, intent(in) :: cnode
      integer(c_int) :: catalyst_code
    end function c_catalyst_initialize

    function c_catalyst_execute(cnode) result(catalyst_code) bind(C, name="catalyst_execute")
      import :: c_int, c_ptr
      type(c_ptr), value, intent(in) :: cnode
      integer(c_int) :: catalyst_code
    end function c_catalyst_execute

    function c_catalyst_finalize(cnode) result(catalyst_code) bind(C, name="catalyst_finalize")
      import :: c_int, c_ptr
      type(c_ptr), value, intent(in) :: cnode
      integer(c_int) :: catalyst_code
    end function c_catalyst_finalize

    function c_catalyst_about(cnode) result(catalyst_code) bind(C, name="catalyst_about")
      import :: c_int, c_ptr
      type(c_ptr), value, intent(in) :: cnode
      integer(c_int) :: catalyst_code
    end function c_catalyst_about

    function c_catalyst_results(cnode) result(catalyst_code) bind(C, name="catalyst_results")
      import :: c_int, c_ptr
      type(c_ptr), value, intent(in) :: cnode
      integer(c_int) :: catalyst_code
    end function c_catalyst_results
  end interface
end module catalyst_api
