#include "server/machine/file_limit.h"

#include <sys/resource.h>

namespace isomatch {
namespace {

constexpr std::int64_t kMostFiles = std::int64_t{1} << 20;

std::int64_t Cap(rlim_t limit) {
  return limit > static_cast<rlim_t>(kMostFiles)
             ? kMostFiles
             : static_cast<std::int64_t>(limit);
}

}  // namespace

void RaiseFileLimit() {
  rlimit limit{};
  if (getrlimit(RLIMIT_NOFILE, &limit) != 0) return;
  const auto wanted = static_cast<rlim_t>(Cap(limit.rlim_max));
  if (wanted <= limit.rlim_cur) return;
  limit.rlim_cur = wanted;
  setrlimit(RLIMIT_NOFILE, &limit);
}

std::int64_t FileLimit() {
  rlimit limit{};
  return getrlimit(RLIMIT_NOFILE, &limit) == 0 ? Cap(limit.rlim_cur)
                                               : std::int64_t{1024};
}

}  // namespace isomatch
