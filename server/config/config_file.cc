#include "server/config/config_file.h"

#include <algorithm>
#include <optional>
#include <sstream>

#include "absl/status/status.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/string_view.h"

#define TOML_EXCEPTIONS 0
#include <toml++/toml.h>

namespace isomatch {
namespace {

absl::Status WrongLine(const toml::source_region& place,
                       absl::string_view what) {
  return absl::InvalidArgumentError(
      absl::StrCat("line ", place.begin.line, ": ", what));
}

/// As a flag has it on the command line; none for what flags cannot be.
std::optional<std::string> TextOf(const toml::node& node) {
  if (const auto* text = node.as_string()) return text->get();
  if (!node.is_number() && !node.is_boolean()) return std::nullopt;
  // Its own formatter prints what it can read again, all digits of it.
  std::ostringstream value;
  value << toml::toml_formatter(node, toml::format_flags::none);
  return value.str();
}

}  // namespace

absl::StatusOr<std::vector<ConfigEntry>> ReadConfigFile(std::istream& file) {
  const toml::parse_result parsed = toml::parse(file);
  if (!parsed) {
    const toml::parse_error& error = parsed.error();
    const std::string_view what = error.description();
    return WrongLine(error.source(),
                     absl::StrCat(absl::string_view(what.data(), what.size()),
                                  "; expected KEY = VALUE, texts in quotes"));
  }
  std::vector<ConfigEntry> entries;
  for (const auto& [key, node] : parsed.table()) {
    const std::string name(key.str());
    std::optional<std::string> value = TextOf(node);
    if (!value) {
      return WrongLine(
          key.source(),
          absl::StrCat(name,
                       ": expected a number, true, false or a string in "
                       "quotes"));
    }
    const auto line = static_cast<int>(key.source().begin.line);
    entries.push_back({line, name, *std::move(value)});
  }
  std::sort(entries.begin(), entries.end(),
            [](const ConfigEntry& a, const ConfigEntry& b) {
              return a.line < b.line;
            });
  return entries;
}

std::string QuoteConfigValue(const std::string& text) {
  const toml::value<std::string> value(text);
  std::ostringstream quoted;
  quoted << toml::toml_formatter(value, toml::format_flags::none);
  return quoted.str();
}

}  // namespace isomatch
