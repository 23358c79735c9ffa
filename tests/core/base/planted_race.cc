// A race on purpose, which ThreadSanitizer has to report: that it can see into
// the tasks of core, so that its silence about core means something.

#include <atomic>
#include <cstdint>
#include <string_view>

#include "core/base/parallel.h"

int main(int argc, char** argv) {
  int shared = 0;
  // Both tasks have begun before either goes on, and know no more than that of
  // one another.
  std::atomic<int> begun = 0;
  const auto race = [&] {
    begun.fetch_add(1, std::memory_order_relaxed);
    while (begun.load(std::memory_order_relaxed) < 2) {
    }
    ++shared;
    return absl::OkStatus();
  };
  if (argc > 1 && std::string_view(argv[1]) == "RunBoth") {
    return isomatch::RunBoth(race, race).ok() ? 0 : 1;
  }
  return isomatch::ParallelFor(2, {}, [&](std::int64_t) { (void)race(); }).ok()
             ? 0
             : 1;
}
