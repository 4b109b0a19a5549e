# Finds this Catalyst: the targets catalyst::catalyst and, where it was installed, catalyst::catalyst_fortran. The component SDK
# brings the function catalyst_implementation.
cmake_policy(PUSH)
cmake_policy(VERSION 3.13...3.31)

get_filename_component(_catalyst_library_directory "${CMAKE_CURRENT_LIST_DIR}/../.." ABSOLUTE)
get_filename_component(_catalyst_prefix "${_catalyst_library_directory}/.." ABSOLUTE)
set(_catalyst_include "${_catalyst_prefix}/include/catalyst-2.0")

if (NOT TARGET catalyst::catalyst)
  add_library(catalyst::catalyst SHARED IMPORTED)
  set_target_properties(catalyst::catalyst PROPERTIES
    IMPORTED_LOCATION "${_catalyst_library_directory}/libcatalyst.so.3"
    IMPORTED_SONAME "libcatalyst.so.3"
    INTERFACE_INCLUDE_DIRECTORIES "${_catalyst_include}"
    INTERFACE_COMPILE_FEATURES "c_std_99;cxx_std_11")
  # The headers by themselves, and the parts that Catalyst has as libraries of their own.
  foreach (_catalyst_part IN ITEMS catalyst conduit blueprint)
    add_library(catalyst::${_catalyst_part}_headers INTERFACE IMPORTED)
    set_target_properties(catalyst::${_catalyst_part}_headers PROPERTIES
      INTERFACE_INCLUDE_DIRECTORIES "${_catalyst_include}")
  endforeach ()
  foreach (_catalyst_part IN ITEMS conduit blueprint)
    add_library(catalyst::${_catalyst_part} INTERFACE IMPORTED)
    set_target_properties(catalyst::${_catalyst_part} PROPERTIES
      INTERFACE_LINK_LIBRARIES catalyst::catalyst)
  endforeach ()
endif ()

set(catalyst_VERSION "2.0.0")
set(CATALYST_VERSION "2.0.0")
set(CATALYST_ABI_VERSION "3")
set(CATALYST_BUILD_SHARED_LIBS ON)
set(CATALYST_USE_MPI OFF)
set(CATALYST_WRAP_PYTHON OFF)
set(CATALYST_WRAP_FORTRAN OFF)
set(catalyst_SDK_FOUND 1)
set(catalyst_Fortran_FOUND 0)
set(catalyst_FORTRAN_FOUND 0)
if (EXISTS "${_catalyst_library_directory}/libcatalyst_fortran.so")
  set(CATALYST_WRAP_FORTRAN ON)
  set(catalyst_Fortran_FOUND 1)
  set(catalyst_FORTRAN_FOUND 1)
  if (NOT TARGET catalyst::catalyst_fortran)
    add_library(catalyst::catalyst_fortran SHARED IMPORTED)
    set_target_properties(catalyst::catalyst_fortran PROPERTIES
      IMPORTED_LOCATION "${_catalyst_library_directory}/libcatalyst_fortran.so"
      INTERFACE_INCLUDE_DIRECTORIES "${_catalyst_include}"
      INTERFACE_LINK_LIBRARIES catalyst::catalyst)
  endif ()
endif ()

# Where Python finds the packages `catalyst` and `catalyst_conduit`.
set(catalyst_PYTHON_FOUND 0)
file(GLOB CATALYST_PYTHON_MODULE_DIRECTORY "${_catalyst_library_directory}/python3*/site-packages")
set(CATALYST_PYTHONPATH "${CATALYST_PYTHON_MODULE_DIRECTORY}")
if (CATALYST_PYTHON_MODULE_DIRECTORY)
  set(CATALYST_WRAP_PYTHON ON)
  set(catalyst_PYTHON_FOUND 1)
endif ()
set(catalyst_Python_FOUND ${catalyst_PYTHON_FOUND})

if ("SDK" IN_LIST catalyst_FIND_COMPONENTS)
  include("${CMAKE_CURRENT_LIST_DIR}/catalyst-macros.cmake")
endif ()

set(catalyst_FOUND 1)
foreach (_catalyst_component IN LISTS catalyst_FIND_COMPONENTS)
  if (catalyst_FIND_REQUIRED_${_catalyst_component} AND NOT catalyst_${_catalyst_component}_FOUND)
    set(catalyst_FOUND 0)
    list(APPEND catalyst_NOT_FOUND_MESSAGE "the component ${_catalyst_component} is not installed")
  endif ()
endforeach ()
cmake_policy(POP)
