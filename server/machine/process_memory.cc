#include "server/machine/process_memory.h"

#include <malloc.h>
#include <unistd.h>

#include <cstddef>
#include <fstream>

#include "server/machine/proc_file.h"

// Of jemalloc, where the program has it (program_heap.cc).
extern "C" [[gnu::weak]] int mallctl(const char* name, void* old_value,
                                     std::size_t* old_length, void* new_value,
                                     std::size_t new_length);

namespace isomatch {

void ResetPeakResidentBytes() {
  // "5" resets the peak: see clear_refs in proc(5).
  std::ofstream("/proc/self/clear_refs") << "5";
}

std::int64_t PeakResidentBytes() {
  return ReadProcBytes("/proc/self/status", "VmHWM").value_or(0);
}

std::int64_t ResidentBytes() {
  std::ifstream statm("/proc/self/statm");
  std::int64_t pages = 0;
  std::int64_t resident_pages = 0;
  if (!(statm >> pages >> resident_pages)) return 0;
  return resident_pages * sysconf(_SC_PAGESIZE);
}

void ReleaseFreedMemory() {
  malloc_trim(0);
  if (mallctl == nullptr) return;
  // 4096 is MALLCTL_ARENAS_ALL.
  mallctl("arena.4096.purge", nullptr, nullptr, nullptr, 0);
}

}  // namespace isomatch
