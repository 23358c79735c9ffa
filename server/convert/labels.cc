#include "server/convert/labels.h"

#include "absl/strings/str_cat.h"
#include "server/convert/request_limits.h"
#include "server/jobs/errors.h"

namespace isomatch {

absl::StatusOr<std::map<std::string, std::string>> ParseLabels(
    const google::protobuf::Map<std::string, std::string>& labels,
    const std::string& field) {
  if (labels.size() > RequestLimits::kMaxLabels) {
    return InvalidField(
        field, absl::StrCat(labels.size(), " of them, expected at most ",
                            RequestLimits::kMaxLabels));
  }
  for (const auto& [key, value] : labels) {
    if (key.empty() || key.size() > RequestLimits::kMaxLabelKeyBytes ||
        value.size() > RequestLimits::kMaxLabelValueBytes) {
      return InvalidField(field,
                          absl::StrCat("expected keys of 1 to ",
                                       RequestLimits::kMaxLabelKeyBytes,
                                       " bytes and values of at most ",
                                       RequestLimits::kMaxLabelValueBytes));
    }
  }
  return std::map<std::string, std::string>(labels.begin(), labels.end());
}

}  // namespace isomatch
