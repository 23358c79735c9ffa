#include "client/files/word_cursor.h"

#include <cmath>

#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "client/files/text_file.h"

namespace isomatch {

absl::string_view WordCursor::Take() {
  return LeftAhead() > 0 ? words_[next_++] : "";
}

std::size_t WordCursor::LeftAhead() {
  while (next_ == words_.size() && !rest_.empty()) TakeLine();
  return LeftOnLine();
}

absl::Span<const absl::string_view> WordCursor::TakeRestOfLine() {
  const auto rest = absl::MakeConstSpan(words_).subspan(next_);
  next_ = words_.size();
  return rest;
}

std::string WordCursor::Place() const { return absl::StrCat("line ", line_); }

void WordCursor::TakeLine() {
  const std::size_t end = rest_.find('\n');
  const absl::string_view row = rest_.substr(0, end);
  rest_.remove_prefix(end == absl::string_view::npos ? rest_.size() : end + 1);
  words_ = SplitWords(row.substr(0, row.find('#')));
  next_ = 0;
  ++line_;
}

std::string Quoted(absl::string_view word) {
  constexpr std::size_t kMostShown = 40;
  return absl::StrCat("'", word.substr(0, kMostShown), "'");
}

bool ReadFinite(absl::string_view word, double* number) {
  return absl::SimpleAtod(word, number) && std::isfinite(*number);
}

}  // namespace isomatch
