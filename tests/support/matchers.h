#pragma once

#include <string>

#include <gmock/gmock.h>

#include "absl/status/status.h"
#include "absl/status/statusor.h"

namespace isomatch {

// The packaged abseil has no matchers for its statuses; these are ours.

inline const absl::Status& GetStatus(const absl::Status& status) {
  return status;
}
template <typename T>
const absl::Status& GetStatus(const absl::StatusOr<T>& status_or) {
  return status_or.status();
}

MATCHER(IsOk, "is OK") {
  *result_listener << "is " << GetStatus(arg).ToString();
  return GetStatus(arg).ok();
}

/// StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("landmarks[3]")).
MATCHER_P2(StatusIs, code, message_matcher, "has that code and message") {
  *result_listener << "is " << GetStatus(arg).ToString();
  return GetStatus(arg).code() == code &&
         testing::ExplainMatchResult(message_matcher,
                                     std::string(GetStatus(arg).message()),
                                     result_listener);
}

}  // namespace isomatch
