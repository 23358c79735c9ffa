#include "server/machine/process_memory.h"

#include <malloc.h>
#include <unistd.h>

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

std::int64_t ResidentBytes() {
  std::ifstream statm("/proc/self/statm");
  std::int64_t pages = 0;
  std::int64_t resident_pages = 0;
  if (!(statm >> pages >> resident_pages)) return 0;
  return resident_pages * sysconf(_SC_PAGESIZE);
}

void ReleaseFreedMemory() { malloc_trim(0); }

}  // namespace isomatch
