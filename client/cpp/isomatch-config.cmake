# find_package(isomatch CONFIG REQUIRED) gives the target isomatch::client.
include(CMakeFindDependencyMacro)
find_dependency(Threads)
find_dependency(Protobuf)  # module mode, before gRPC
find_dependency(gRPC CONFIG)
find_dependency(absl CONFIG)
find_dependency(Eigen3 CONFIG)
find_dependency(draco CONFIG)
find_dependency(OpenSSL)
include(${CMAKE_CURRENT_LIST_DIR}/isomatch-targets.cmake)
