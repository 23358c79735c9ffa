#pragma once

#include <istream>
#include <string>
#include <vector>

#include "absl/status/statusor.h"

namespace isomatch {

/// One "key = value" of a configuration file.
struct ConfigEntry {
  int line = 0;
  std::string key;
  std::string value;
};

/// Reads a file of lines such as
///
///   # a comment
///   workers = 2
///   listen = "127.0.0.1:7443"   # quotes where the value has a # or a space
///
/// a subset of TOML, except that strings may go without quotes. Keys are flags
/// without their dashes. INVALID_ARGUMENT naming the line: no such line, or a
/// key that came before.
absl::StatusOr<std::vector<ConfigEntry>> ReadConfigFile(std::istream& file);

/// Returns `text` in quotes, as ReadConfigFile reads it back.
/// REQUIRES: no line ends in it.
std::string QuoteConfigValue(const std::string& text);

}  // namespace isomatch
