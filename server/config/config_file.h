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

/// Reads a TOML file whose keys are flags without their dashes:
///
///   # a comment
///   workers = 2
///   listen = "127.0.0.1:7443"
///
/// Values are strings, numbers and truth values. Entries are in the order of
/// the file. INVALID_ARGUMENT naming the line: no TOML, a key that comes twice,
/// or a value that is none of these.
absl::StatusOr<std::vector<ConfigEntry>> ReadConfigFile(std::istream& file);

/// Returns `text` in quotes, as ReadConfigFile reads it back.
/// REQUIRES: no line ends in it.
std::string QuoteConfigValue(const std::string& text);

}  // namespace isomatch
