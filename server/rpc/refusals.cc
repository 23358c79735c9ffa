#include "server/rpc/refusals.h"

#include <algorithm>

#include "absl/strings/str_cat.h"
#include "server/logging/log.h"

namespace isomatch {
namespace {

const char* Describe(Refusal why) {
  switch (why) {
    case Refusal::kNoDescriptor:
      return "the process has no file descriptor left; see ulimit -n";
    case Refusal::kTooMany:
      return "there are as many as --max-connections allows";
    case Refusal::kTooManyOfOrigin:
      return "one address has as many as --max-connections-per-address allows";
  }
  return "";
}

}  // namespace

void Refusals::Add(Refusal why, Clock::time_point now) {
  Episode& episode = episodes_[static_cast<size_t>(why)];
  if (episode.count == 0) {
    Log(LogLevel::kWarning,
        absl::StrCat("new connections are refused: ", Describe(why)));
  }
  ++episode.count;
  episode.last = now;
  ++total_;
}

void Refusals::Tell(Clock::time_point now) {
  for (int i = 0; i < kRefusals; ++i) {
    Episode& episode = episodes_[i];
    if (episode.count == 0 || now < episode.last + kQuiet) continue;
    Log(LogLevel::kInfo,
        absl::StrCat("connections are no longer refused; ", episode.count,
                     " were: ", Describe(static_cast<Refusal>(i))),
        {{"refused", episode.count}});
    episode.count = 0;
  }
}

bool Refusals::is_open() const {
  return std::any_of(episodes_.begin(), episodes_.end(),
                     [](const Episode& episode) { return episode.count > 0; });
}

}  // namespace isomatch
