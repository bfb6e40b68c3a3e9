# find_package(trued_client 1) gives trued::client (shared) and trued::client_static. Works wherever the prefix stands.
get_filename_component(_trued_prefix "${CMAKE_CURRENT_LIST_DIR}/../../@UP@" ABSOLUTE)

if(NOT TARGET trued::client)
  add_library(trued::client SHARED IMPORTED)
  set_target_properties(trued::client PROPERTIES
    IMPORTED_LOCATION "${_trued_prefix}/@LIBDIR@/libtrued_client.so.@ABI@"
    IMPORTED_SONAME "libtrued_client.so.@ABI@"
    INTERFACE_INCLUDE_DIRECTORIES "${_trued_prefix}/include")
endif()

if(NOT TARGET trued::client_static AND EXISTS "${_trued_prefix}/@LIBDIR@/libtrued_client.a")
  add_library(trued::client_static STATIC IMPORTED)
  set_target_properties(trued::client_static PROPERTIES
    IMPORTED_LOCATION "${_trued_prefix}/@LIBDIR@/libtrued_client.a"
    INTERFACE_LINK_LIBRARIES "@LIBS_STATIC@"
    INTERFACE_INCLUDE_DIRECTORIES "${_trued_prefix}/include")
endif()

unset(_trued_prefix)
