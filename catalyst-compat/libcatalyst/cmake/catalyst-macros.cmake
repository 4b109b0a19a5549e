# catalyst_implementation(
#   TARGET <target> NAME <name>
#   [SOURCES <source>...] [EXPORT <export>] [LIBRARY_DESTINATION <directory>] [CATALYST_TARGET <target>])
#
# Makes the library libcatalyst-<name>.so from sources that define catalyst_{initialize,execute,finalize,about,results}_<name>, as
# the header catalyst_impl_<name>.h declares them. Header and table are written to the build directory. Built and installed, the
# library is in LIBRARY_DESTINATION (lib/catalyst), where Catalyst looks for it.
set(_catalyst_macro_directory "${CMAKE_CURRENT_LIST_DIR}")

function (catalyst_implementation)
  cmake_parse_arguments(PARSE_ARGV 0 _impl "" "TARGET;NAME;EXPORT;LIBRARY_DESTINATION;CATALYST_TARGET" "SOURCES")
  if (_impl_UNPARSED_ARGUMENTS)
    message(FATAL_ERROR "catalyst_implementation does not know '${_impl_UNPARSED_ARGUMENTS}'.")
  endif ()
  foreach (_impl_needed IN ITEMS TARGET NAME)
    if (NOT _impl_${_impl_needed})
      message(FATAL_ERROR "catalyst_implementation needs ${_impl_needed}.")
    endif ()
  endforeach ()
  if (NOT _impl_CATALYST_TARGET)
    set(_impl_CATALYST_TARGET catalyst::catalyst)
  endif ()
  if (NOT TARGET "${_impl_CATALYST_TARGET}")
    message(FATAL_ERROR "catalyst_implementation: there is no target '${_impl_CATALYST_TARGET}'.")
  endif ()
  if (NOT _impl_LIBRARY_DESTINATION)
    if (CMAKE_INSTALL_LIBDIR)
      set(_impl_LIBRARY_DESTINATION "${CMAKE_INSTALL_LIBDIR}/catalyst")
    else ()
      set(_impl_LIBRARY_DESTINATION "lib/catalyst")
    endif ()
  endif ()

  set(_impl_stem "${CMAKE_CURRENT_BINARY_DIR}/catalyst_impl_${_impl_NAME}")
  set(CATALYST_IMPLEMENTATION "${_impl_NAME}")
  configure_file("${_catalyst_macro_directory}/catalyst_impl.h.in" "${_impl_stem}.h" @ONLY)
  configure_file("${_catalyst_macro_directory}/catalyst_impl.c.in" "${_impl_stem}.c" @ONLY)

  # A library that a program loads, unless static ones are asked for by name.
  if (DEFINED BUILD_SHARED_LIBS AND NOT BUILD_SHARED_LIBS)
    add_library("${_impl_TARGET}" STATIC "${_impl_stem}.c" "${_impl_stem}.h" ${_impl_SOURCES})
  else ()
    add_library("${_impl_TARGET}" MODULE "${_impl_stem}.c" "${_impl_stem}.h" ${_impl_SOURCES})
  endif ()
  target_include_directories("${_impl_TARGET}" PRIVATE "${CMAKE_CURRENT_BINARY_DIR}")
  target_link_libraries("${_impl_TARGET}" PUBLIC "${_impl_CATALYST_TARGET}")
  set_target_properties("${_impl_TARGET}" PROPERTIES
    PREFIX lib
    OUTPUT_NAME "catalyst-${_impl_NAME}"
    LIBRARY_OUTPUT_DIRECTORY "${CMAKE_BINARY_DIR}/${_impl_LIBRARY_DESTINATION}")

  set(_impl_export)
  if (_impl_EXPORT)
    set(_impl_export EXPORT "${_impl_EXPORT}")
  endif ()
  install(TARGETS "${_impl_TARGET}" ${_impl_export}
    LIBRARY DESTINATION "${_impl_LIBRARY_DESTINATION}"
    ARCHIVE DESTINATION "${_impl_LIBRARY_DESTINATION}")
endfunction ()
