#include "client/cli/option_support.h"

#include <algorithm>
#include <cstddef>
#include <utility>

#include "absl/strings/ascii.h"
#include "absl/strings/match.h"
#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"

namespace isomatch {
namespace {

// Damerau and Levenshtein's distance of two words, without letters moved twice.
std::size_t EditDistance(absl::string_view a, absl::string_view b) {
  std::vector<std::vector<std::size_t>> least(
      a.size() + 1, std::vector<std::size_t>(b.size() + 1));
  for (std::size_t i = 0; i <= a.size(); ++i) {
    for (std::size_t j = 0; j <= b.size(); ++j) {
      if (i == 0 || j == 0) {
        least[i][j] = i + j;
        continue;
      }
      least[i][j] = std::min({least[i - 1][j] + 1, least[i][j - 1] + 1,
                              least[i - 1][j - 1] + (a[i - 1] != b[j - 1])});
      if (i > 1 && j > 1 && a[i - 1] == b[j - 2] && a[i - 2] == b[j - 1]) {
        least[i][j] = std::min(least[i][j], least[i - 2][j - 2] + 1);
      }
    }
  }
  return least[a.size()][b.size()];
}

}  // namespace

CLI::Validator WholeNumber(std::uint64_t least, std::uint64_t most) {
  return CLI::Validator(
      [least, most](std::string& text) -> std::string {
        std::uint64_t number = 0;
        const bool is_number =
            !text.empty() &&
            std::all_of(text.begin(), text.end(), absl::ascii_isdigit) &&
            absl::SimpleAtoi(text, &number);
        if (is_number && least <= number && number <= most) return "";
        return absl::StrCat("'", text, "', expected a whole number from ",
                            least, " to ", most);
      },
      "");
}

CLI::Validator MemorySize() {
  return CLI::Validator(
      [](std::string& text) -> std::string {
        const std::string found = text;
        const bool begins_well =
            !text.empty() &&
            absl::ascii_isdigit(static_cast<unsigned char>(text.front()));
        std::uint64_t bytes = 0;
        try {
          if (begins_well && CLI::AsSizeValue(true)(text).empty() &&
              absl::SimpleAtoi(text, &bytes)) {
            return "";
          }
        } catch (const CLI::Error&) {
          // Told below.
        }
        return absl::StrCat("'", found,
                            "', expected a number of bytes, e.g. 800MB, 2GB or "
                            "512MiB");
      },
      "");
}

CLI::Option* SetChoices(CLI::Option* option, const std::string& name,
                        const std::vector<std::string>& choices) {
  return option->check(CLI::IsMember(choices))->type_name(name);
}

std::vector<std::string> ChoicesOf(const CLI::Option& option) {
  const std::string text = option.get_type_name();
  const std::size_t begin = text.find('{');
  const std::size_t end = text.rfind('}');
  if (begin == std::string::npos || end == std::string::npos) return {};
  return absl::StrSplit(text.substr(begin + 1, end - begin - 1), ',');
}

std::string PlaceholderOf(const CLI::Option& option) {
  const std::string text = option.get_type_name();
  const std::size_t end = text.find(":{");
  return text.substr(0, end);
}

void SetGroup(CLI::App* command, const char* group,
              std::initializer_list<const char*> options) {
  for (const char* name : options) command->get_option(name)->group(group);
}

std::optional<std::string> DidYouMean(
    absl::string_view word, const std::vector<std::string>& candidates) {
  constexpr std::size_t kLettersPerMistake = 4;
  constexpr std::size_t kShortestPrefix = 3;
  const std::size_t most =
      std::max(std::size_t{2}, word.size() / kLettersPerMistake);
  std::optional<std::pair<std::size_t, std::string>> nearest;
  for (const std::string& candidate : candidates) {
    const bool begins =
        word.size() >= kShortestPrefix && absl::StartsWith(candidate, word);
    const std::size_t distance = begins ? 1 : EditDistance(word, candidate);
    // Nothing is left of a short word that is all mistakes.
    if (distance > most || distance >= candidate.size()) continue;
    if (!nearest || distance < nearest->first) {
      nearest = {distance, candidate};
    }
  }
  if (!nearest) return std::nullopt;
  return nearest->second;
}

}  // namespace isomatch
