#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>

#include "absl/strings/string_view.h"

namespace isomatch {

/// The most that a JSON text may have, so that what is made of it is not much
/// larger than it.
struct JsonLimits {
  int depth = 64;
  std::int64_t values = std::int64_t{1} << 20;
  std::int64_t objects = std::int64_t{1} << 16;
};

/// Why a text is refused.
struct JsonFault {
  /// Where, for what is no JSON.
  std::optional<std::size_t> byte;
  /// What was found and what was expected.
  std::string what;
};

/// Returns what is wrong with a text first: it is no JSON, or has more than
/// `limits` allow. Nothing is kept of it. Time O(size).
std::optional<JsonFault> CheckJsonText(absl::string_view text,
                                       const JsonLimits& limits);

}  // namespace isomatch
