#include "server/machine/file_limit.h"

#include <algorithm>

#include <sys/resource.h>

namespace isomatch {
namespace {

constexpr std::int64_t kMostFiles = std::int64_t{1} << 20;
/// An idle connection takes about 20 kB, so this many take 200 MB.
constexpr std::int64_t kMostConnections = 10'000;
constexpr std::int64_t kMostReserved = 1024;

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

ConnectionLimits ChooseConnectionLimits(int most, int of_one_address,
                                        std::int64_t files) {
  const std::int64_t room = files - std::min(kMostReserved, files / 4);
  const std::int64_t wanted = most > 0 ? most : kMostConnections;
  ConnectionLimits limits{};
  limits.most =
      static_cast<int>(std::max(std::int64_t{1}, std::min(wanted, room)));
  limits.of_one_address =
      of_one_address > 0 ? of_one_address : std::max(1, limits.most / 8);
  return limits;
}

}  // namespace isomatch
