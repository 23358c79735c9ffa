#pragma once

#include <map>
#include <string>

#include <google/protobuf/map.h>

#include "absl/status/statusor.h"

namespace isomatch {

/// Returns labels of a request, checked as service.proto has them.
/// INVALID_ARGUMENT (INVALID_FIELD) on `field`.
absl::StatusOr<std::map<std::string, std::string>> ParseLabels(
    const google::protobuf::Map<std::string, std::string>& labels,
    const std::string& field);

}  // namespace isomatch
