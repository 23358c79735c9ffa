#include "server/jobs/process_memory.h"

#include <fstream>
#include <limits>
#include <string>

namespace isomatch {

void ResetPeakResidentBytes() {
  // "5" resets the peak: see clear_refs in proc(5).
  std::ofstream("/proc/self/clear_refs") << "5";
}

std::int64_t PeakResidentBytes() {
  std::ifstream status("/proc/self/status");
  std::string key;
  std::int64_t kibibytes = 0;
  while (status >> key) {
    if (key == "VmHWM:" && status >> kibibytes) return kibibytes * 1024;
    status.ignore(std::numeric_limits<std::streamsize>::max(), '\n');
  }
  return 0;
}

}  // namespace isomatch
