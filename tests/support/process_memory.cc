#include "tests/support/process_memory.h"

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

std::int64_t ResidentBytes() { return StatusBytes("VmRSS"); }
std::int64_t PeakResidentBytes() { return StatusBytes("VmHWM"); }

void ResetPeakResidentBytes() {
  malloc_trim(0);
  std::ofstream("/proc/self/clear_refs") << "5";
}

}  // namespace isomatch
