#include "client/files/word_cursor.h"

#include <charconv>
#include <cmath>
#include <cstdint>
#include <system_error>

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

template <typename Number>
bool WordCursor::TakeNumbers(absl::Span<Number> numbers,
                             absl::FunctionRef<bool()> accepts) {
  if (LeftOnLine() > 0) return false;
  absl::string_view& rest = lines_.rest;
  const char* at = rest.data();
  const char* const end = at + rest.size();
  for (Number& number : numbers) {
    const auto [stop, error] = std::from_chars(at, end, number);
    if (error != std::errc()) return false;
    for (at = stop; at != end && (*at == ' ' || *at == '\r'); ++at) {
    }
    if (at == stop && &number != &numbers.back()) return false;
  }
  if (at == end || *at != '\n' || !accepts()) return false;
  rest.remove_prefix(static_cast<std::size_t>(at + 1 - rest.data()));
  ++lines_.number;
  return true;
}

template bool WordCursor::TakeNumbers(absl::Span<double>,
                                      absl::FunctionRef<bool()>);
template bool WordCursor::TakeNumbers(absl::Span<std::int64_t>,
                                      absl::FunctionRef<bool()>);

std::string WordCursor::Where() const { return absl::StrCat("line ", line()); }

bool ReadFinite(absl::string_view word, double* number) {
  return (ReadPlain(word, number) || absl::SimpleAtod(word, number)) &&
         std::isfinite(*number);
}

}  // namespace isomatch
