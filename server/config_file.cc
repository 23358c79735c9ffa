#include "server/config_file.h"

#include <algorithm>
#include <set>
#include <utility>

#include "absl/status/status.h"
#include "absl/strings/ascii.h"
#include "absl/strings/str_cat.h"
#include "core/base/status_macros.h"

namespace isomatch {
namespace {

absl::Status WrongLine(int line, absl::string_view what) {
  return absl::InvalidArgumentError(absl::StrCat("line ", line, ": ", what));
}

bool IsKey(absl::string_view text) {
  return !text.empty() && absl::ascii_isalpha(text[0]) &&
         std::all_of(text.begin(), text.end(), [](char c) {
           return absl::ascii_isalnum(c) || c == '-' || c == '_';
         });
}

/// True when nothing but a comment is left.
bool IsRest(absl::string_view text) {
  text = absl::StripLeadingAsciiWhitespace(text);
  return text.empty() || text[0] == '#';
}

/// Reads "..." with \" and \\, or '...'. False: it is neither.
bool ReadQuoted(absl::string_view text, std::string& value) {
  const char quote = text[0];
  for (size_t i = 1; i < text.size(); ++i) {
    if (text[i] == quote) return IsRest(text.substr(i + 1));
    if (text[i] == '\\' && quote == '"') {
      if (++i == text.size() || (text[i] != '"' && text[i] != '\\')) {
        return false;
      }
    }
    value += text[i];
  }
  return false;
}

bool ReadValue(absl::string_view text, std::string& value) {
  if (text.empty()) return false;
  if (text[0] == '"' || text[0] == '\'') return ReadQuoted(text, value);
  value = std::string(text.substr(0, text.find_first_of(" \t#\"'[]")));
  return !value.empty() && IsRest(text.substr(value.size()));
}

absl::StatusOr<ConfigEntry> ReadEntry(int line, absl::string_view text) {
  const size_t equals = text.find('=');
  if (equals == absl::string_view::npos) {
    return WrongLine(line, "expected KEY = VALUE");
  }
  ConfigEntry entry{
      line, std::string(absl::StripAsciiWhitespace(text.substr(0, equals))),
      ""};
  if (!IsKey(entry.key)) {
    return WrongLine(line,
                     "expected KEY = VALUE, KEY being a flag's name "
                     "without its dashes");
  }
  if (!ReadValue(absl::StripAsciiWhitespace(text.substr(equals + 1)),
                 entry.value)) {
    return WrongLine(line, absl::StrCat(entry.key,
                                        ": expected a word, a number, true, "
                                        "false or a string in quotes"));
  }
  return entry;
}

}  // namespace

absl::StatusOr<std::vector<ConfigEntry>> ReadConfigFile(std::istream& file) {
  std::vector<ConfigEntry> entries;
  std::set<std::string> keys;
  int line = 0;
  for (std::string text; std::getline(file, text);) {
    ++line;
    if (IsRest(text)) continue;
    ISOMATCH_ASSIGN_OR_RETURN(ConfigEntry entry, ReadEntry(line, text));
    if (!keys.insert(entry.key).second) {
      return WrongLine(line, absl::StrCat(entry.key, " comes twice"));
    }
    entries.push_back(std::move(entry));
  }
  return entries;
}

std::string QuoteConfigValue(const std::string& text) {
  std::string quoted = "\"";
  for (const char c : text) {
    if (c == '"' || c == '\\') quoted += '\\';
    quoted += c;
  }
  return absl::StrCat(quoted, "\"");
}

}  // namespace isomatch
