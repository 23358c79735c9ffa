# For `cmake --toolchain`: Debian's cross compiler, and the libraries that
# docker/cross/sysroot has laid out in ISOMATCH_SYSROOT.
set(CMAKE_SYSTEM_NAME Linux)
set(CMAKE_SYSTEM_PROCESSOR aarch64)
set(CMAKE_C_COMPILER aarch64-linux-gnu-gcc)
set(CMAKE_CXX_COMPILER aarch64-linux-gnu-g++)
set(CMAKE_TRY_COMPILE_PLATFORM_VARIABLES ISOMATCH_SYSROOT)

set(CMAKE_SYSROOT ${ISOMATCH_SYSROOT})
set(CMAKE_LIBRARY_ARCHITECTURE aarch64-linux-gnu)
set(CMAKE_FIND_ROOT_PATH_MODE_PROGRAM NEVER)
set(CMAKE_FIND_ROOT_PATH_MODE_LIBRARY ONLY)
set(CMAKE_FIND_ROOT_PATH_MODE_INCLUDE ONLY)
set(CMAKE_FIND_ROOT_PATH_MODE_PACKAGE ONLY)
set(ENV{PKG_CONFIG_SYSROOT_DIR} ${ISOMATCH_SYSROOT})
set(ENV{PKG_CONFIG_LIBDIR}
  ${ISOMATCH_SYSROOT}/usr/lib/aarch64-linux-gnu/pkgconfig:${ISOMATCH_SYSROOT}/usr/share/pkgconfig)
# The programs say their manual page and completions themselves.
set(CMAKE_CROSSCOMPILING_EMULATOR qemu-aarch64-static;-L;${ISOMATCH_SYSROOT})
