#include "client/files/word_cursor.h"

#include <cmath>

#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"

namespace isomatch {

absl::string_view WordCursor::Take() {
  return LeftAhead() > 0 ? words_[next_++] : "";
}

std::size_t WordCursor::LeftAhead() {
  while (next_ == words_.size() && lines_.Next()) {
    SplitWordsInto(&words_, lines_.line);
    next_ = 0;
  }
  return LeftOnLine();
}

absl::Span<const absl::string_view> WordCursor::TakeRestOfLine() {
  const auto rest = absl::MakeConstSpan(words_).subspan(next_);
  next_ = words_.size();
  return rest;
}

std::string WordCursor::Where() const { return absl::StrCat("line ", line()); }

bool ReadFinite(absl::string_view word, double* number) {
  return absl::SimpleAtod(word, number) && std::isfinite(*number);
}

}  // namespace isomatch
