#include "client/verdict_text.h"

#include "absl/strings/str_cat.h"

namespace isomatch {

std::string VerdictLabel(const v1::Verdict& verdict) {
  switch (verdict.level()) {
    case v1::Verdict::LEVEL_GOOD:
      return "good";
    case v1::Verdict::LEVEL_DOUBTFUL:
      return "doubtful";
    case v1::Verdict::LEVEL_BAD:
      return "bad";
    default:
      return "unknown";
  }
}

std::string VerdictText(const v1::Verdict& verdict) {
  std::string text = VerdictLabel(verdict);
  if (!verdict.reason().empty()) {
    absl::StrAppend(&text, " (", verdict.reason(), ")");
  }
  if (!verdict.advice().empty()) {
    absl::StrAppend(&text, ": ", verdict.advice());
  }
  return text;
}

}  // namespace isomatch
