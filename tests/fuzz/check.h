#pragma once

#include <cstdio>
#include <cstdlib>

/// Ends the process when a property does not hold: what a fuzzer calls a
/// finding. Unlike assert it is always on.
#define ISOMATCH_CHECK(condition)                                           \
  do {                                                                      \
    if (!(condition)) {                                                     \
      std::fprintf(stderr, "%s:%d: %s does not hold\n", __FILE__, __LINE__, \
                   #condition);                                             \
      std::abort();                                                         \
    }                                                                       \
  } while (false)
