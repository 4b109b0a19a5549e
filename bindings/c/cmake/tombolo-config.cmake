# Targets tombolo::tombolo (tombolo.h) and, where the Fortran module is installed, tombolo::tombolo_fortran.
get_filename_component(_tombolo_prefix "${CMAKE_CURRENT_LIST_DIR}/../../.." ABSOLUTE)
if (NOT TARGET tombolo::tombolo)
  add_library(tombolo::tombolo SHARED IMPORTED)
  set_target_properties(tombolo::tombolo PROPERTIES
    IMPORTED_LOCATION "${_tombolo_prefix}/lib/libtombolo.so.0"
    IMPORTED_SONAME "libtombolo.so.0"
    INTERFACE_INCLUDE_DIRECTORIES "${_tombolo_prefix}/include")
endif ()
if (EXISTS "${_tombolo_prefix}/lib/libtombolo_fortran.so" AND NOT TARGET tombolo::tombolo_fortran)
  add_library(tombolo::tombolo_fortran SHARED IMPORTED)
  set_target_properties(tombolo::tombolo_fortran PROPERTIES
    IMPORTED_LOCATION "${_tombolo_prefix}/lib/libtombolo_fortran.so"
    IMPORTED_SONAME "libtombolo_fortran.so"
    INTERFACE_INCLUDE_DIRECTORIES "${_tombolo_prefix}/include"
    INTERFACE_LINK_LIBRARIES tombolo::tombolo)
endif ()
unset(_tombolo_prefix)
