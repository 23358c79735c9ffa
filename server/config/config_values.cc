#include "server/config/config_values.h"

#include <algorithm>
#include <array>
#include <limits>
#include <vector>

#include "absl/strings/ascii.h"
#include "absl/strings/match.h"
#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "absl/strings/str_split.h"
#include "absl/strings/strip.h"

namespace isomatch {
namespace {

constexpr absl::string_view kPrefixes = "kmgt";

/// Returns how many bytes the unit has; 0 when there is no such unit.
std::int64_t UnitBytes(absl::string_view unit) {
  std::string lower = absl::AsciiStrToLower(unit);
  absl::string_view prefix = lower;
  absl::ConsumeSuffix(&prefix, "b");
  if (prefix.empty()) return 1;
  const std::int64_t step = absl::ConsumeSuffix(&prefix, "i") ? 1024 : 1000;
  const size_t power = kPrefixes.find(prefix);
  if (prefix.size() != 1 || power == absl::string_view::npos) return 0;
  std::int64_t bytes = step;
  for (size_t i = 0; i < power; ++i) bytes *= step;
  return bytes;
}

absl::Status NoSize() {
  return absl::InvalidArgumentError("no size such as 4096, 64KiB or 2GB");
}

}  // namespace

absl::StatusOr<std::int64_t> ParseBytes(absl::string_view text) {
  const auto end =
      std::find_if_not(text.begin(), text.end(), absl::ascii_isdigit) -
      text.begin();
  const auto digits = text.substr(0, static_cast<size_t>(end));
  const std::int64_t unit = UnitBytes(
      absl::StripAsciiWhitespace(text.substr(static_cast<size_t>(end))));
  std::int64_t count = 0;
  if (!absl::SimpleAtoi(digits, &count) || unit == 0 ||
      count > std::numeric_limits<std::int64_t>::max() / unit) {
    return NoSize();
  }
  return count * unit;
}

std::string FormatBytes(std::int64_t bytes) {
  constexpr std::array<const char*, 5> kUnits = {"", "KiB", "MiB", "GiB",
                                                 "TiB"};
  size_t unit = 0;
  while (bytes != 0 && bytes % 1024 == 0 && unit + 1 < kUnits.size()) {
    bytes /= 1024;
    ++unit;
  }
  return absl::StrCat(bytes, kUnits[unit]);
}

absl::StatusOr<absl::Duration> ParseDurationValue(absl::string_view text) {
  const bool has_unit = !text.empty() && absl::ascii_isalpha(text.back());
  absl::Duration duration;
  if (!absl::ParseDuration(
          has_unit ? std::string(text) : absl::StrCat(text, "s"), &duration)) {
    return absl::InvalidArgumentError("no time such as 30s or 5m");
  }
  return duration;
}

std::string WithoutPassword(absl::string_view url) {
  constexpr absl::string_view kUserBegins = "://";
  const size_t scheme = url.find(kUserBegins);
  if (scheme == absl::string_view::npos) return "";
  // A ? before any @ may be the password's.
  const size_t first_at = url.find('@');
  const size_t query =
      url.find('?', first_at == absl::string_view::npos ? 0 : first_at);
  const size_t at = url.substr(0, query).rfind('@');
  const size_t colon = url.find(':', scheme + kUserBegins.size());
  std::string text(url);
  if (at != absl::string_view::npos && colon < at) {
    text.erase(colon, at - colon);
  }
  std::vector<std::string> parts = absl::StrSplit(text, absl::ByAnyChar("?&"));
  const std::string place = parts.front();
  parts.erase(parts.begin());
  std::erase_if(parts, [](const std::string& parameter) {
    return absl::StrContains(parameter, "password=");
  });
  return parts.empty() ? place
                       : absl::StrCat(place, "?", absl::StrJoin(parts, "&"));
}

absl::Status WrongValue(absl::string_view field, absl::string_view value,
                        absl::string_view expected) {
  return absl::InvalidArgumentError(
      absl::StrCat(field, " = ", value, ", expected ", expected));
}

absl::Status CheckCount(absl::string_view field, std::int64_t value,
                        const IntRange& range) {
  if (value >= range.least && value <= range.most) return absl::OkStatus();
  return WrongValue(field, absl::StrCat(value), FormatCounts(range));
}

absl::Status CheckBytes(absl::string_view field, std::int64_t value,
                        const IntRange& range) {
  if (value >= range.least && value <= range.most) return absl::OkStatus();
  return WrongValue(field, value < 0 ? absl::StrCat(value) : FormatBytes(value),
                    FormatBytes(range));
}

absl::Status CheckDuration(absl::string_view field, absl::Duration value,
                           const DurationRange& range) {
  if (value >= range.least && value <= range.most) return absl::OkStatus();
  return WrongValue(field, absl::FormatDuration(value), FormatDurations(range));
}

std::string FormatCounts(const IntRange& range) {
  return absl::StrCat(range.least, " to ", range.most);
}

std::string FormatBytes(const IntRange& range) {
  return absl::StrCat(FormatBytes(range.least), " to ",
                      FormatBytes(range.most));
}

std::string FormatDurations(const DurationRange& range) {
  return absl::StrCat(absl::FormatDuration(range.least), " to ",
                      absl::FormatDuration(range.most));
}

}  // namespace isomatch
