# find_package(isomatch CONFIG REQUIRED COMPONENTS core client) gives the targets
# isomatch::core, the method in process, which needs nothing else, and
# isomatch::client, the client of a server. Without COMPONENTS it gives both.
include(CMakeFindDependencyMacro)
set(isomatch_wanted ${isomatch_FIND_COMPONENTS})
if(NOT isomatch_wanted)
  set(isomatch_wanted core client)
endif()
foreach(component IN LISTS isomatch_wanted)
  if(component STREQUAL "core")
    include(${CMAKE_CURRENT_LIST_DIR}/isomatch-core-targets.cmake)
  elseif(component STREQUAL "client")
    find_dependency(Threads)
    find_dependency(Protobuf)  # module mode, before gRPC
    find_dependency(gRPC CONFIG)
    find_dependency(absl CONFIG)
    find_dependency(Eigen3 CONFIG)
    find_dependency(draco CONFIG)
    find_dependency(OpenSSL)
    include(${CMAKE_CURRENT_LIST_DIR}/isomatch-targets.cmake)
  else()
    set(isomatch_FOUND FALSE)
    set(isomatch_NOT_FOUND_MESSAGE
      "isomatch has no component ${component}, expected core or client")
    return()
  endif()
  set(isomatch_${component}_FOUND TRUE)
endforeach()
