#include "tests/support/memory_growth.h"

#include <malloc.h>

#include <fstream>
#include <string>

namespace isomatch {
namespace {

/// A figure of /proc/self/status in bytes.
std::int64_t StatusBytes(const std::string& name) {
  std::ifstream status("/proc/self/status");
  std::string word;
  std::int64_t kilobytes = 0;
  while (status >> word) {
    if (word == name + ":" && status >> kilobytes) return 1024 * kilobytes;
  }
  return 0;
}

}  // namespace

MemoryGrowth::MemoryGrowth() {
  malloc_trim(0);
  // "5" resets the peak: see clear_refs in proc(5).
  std::ofstream("/proc/self/clear_refs") << "5";
  before_ = StatusBytes("VmRSS");
}

std::int64_t MemoryGrowth::Bytes() const {
  return StatusBytes("VmHWM") - before_;
}

}  // namespace isomatch
