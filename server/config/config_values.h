#pragma once

#include <cstdint>
#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"
#include "absl/time/time.h"

namespace isomatch {

// Values of flags: what they may be, how they are read and written.

/// Both ends included.
struct IntRange {
  std::int64_t least;
  std::int64_t most;
};
struct DurationRange {
  absl::Duration least;
  absl::Duration most;
};

/// Returns the whole number of bytes that "4096", "64KiB" or "2 GB" mean; units
/// are B, kB, MB, GB, TB (powers of 1000), KiB, MiB, GiB, TiB (of 1024), in any
/// case, the B may be missing. INVALID_ARGUMENT: none of these.
absl::StatusOr<std::int64_t> ParseBytes(absl::string_view text);

/// Returns what ParseBytes reads back: "4MiB", "4097". REQUIRES: bytes >= 0.
std::string FormatBytes(std::int64_t bytes);

/// Returns the time that "30s", "1h30m", "250ms" or "30", in seconds, mean.
/// INVALID_ARGUMENT: none of these.
absl::StatusOr<absl::Duration> ParseDurationValue(absl::string_view text);

/// Returns a URL of PostgreSQL without :PASSWORD and without ?password=...; in
/// doubt, as when the password has @, / or ? as they are, without too much.
/// Empty when it is no URL.
std::string WithoutPassword(absl::string_view url);

/// INVALID_ARGUMENT naming field, value and range.
absl::Status CheckCount(absl::string_view field, std::int64_t value,
                        const IntRange& range);
absl::Status CheckBytes(absl::string_view field, std::int64_t value,
                        const IntRange& range);
absl::Status CheckDuration(absl::string_view field, absl::Duration value,
                           const DurationRange& range);

/// "FIELD = VALUE, expected EXPECTED".
absl::Status WrongValue(absl::string_view field, absl::string_view value,
                        absl::string_view expected);

/// "1 to 256", "16MiB to 1TiB", "10ms to 1h".
std::string FormatCounts(const IntRange& range);
std::string FormatBytes(const IntRange& range);
std::string FormatDurations(const DurationRange& range);

}  // namespace isomatch
