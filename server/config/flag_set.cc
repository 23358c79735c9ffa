#include "server/config/flag_set.h"

#include <algorithm>
#include <array>
#include <cstdlib>
#include <memory>
#include <utility>

#include <CLI/CLI.hpp>

#include "absl/algorithm/container.h"
#include "absl/strings/ascii.h"
#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_replace.h"
#include "server/config/config_file.h"

namespace isomatch {
namespace {

/// "ISOMATCH_MAX_QUEUED_JOBS" for "--max-queued-jobs".
std::string EnvironmentName(const std::string& flag) {
  return absl::StrCat("ISOMATCH_", absl::AsciiStrToUpper(absl::StrReplaceAll(
                                       flag.substr(2), {{"-", "_"}})));
}

/// Returns "" for a variable that is not set.
std::string ReadEnvironment(const std::string& name) {
  const char* const value = std::getenv(name.c_str());
  return value == nullptr ? "" : value;
}

/// How CLI11 is told of what is wrong with a file.
[[noreturn]] void ThrowConfigError(absl::string_view what) {
  throw CLI::ConfigError(absl::StrCat("--config: ", what),
                         CLI::ExitCodes::ConfigError);
}

/// Reads our files. CLI11 looks at the environment only for flags that the file
/// does not have, so entries that the environment overrides are left out here.
class ConfigFileReader final : public CLI::ConfigBase {
 public:
  explicit ConfigFileReader(const CLI::App& app) : app_(app) {}

  std::vector<CLI::ConfigItem> from_config(std::istream& file) const override {
    const auto entries = ReadConfigFile(file);
    if (!entries.ok()) ThrowConfigError(entries.status().message());
    std::vector<CLI::ConfigItem> found;
    for (const ConfigEntry& entry : *entries) {
      const std::string flag = absl::StrCat("--", entry.key);
      const CLI::Option* const option = app_.get_option_no_throw(flag);
      if (option == nullptr || !option->get_configurable()) {
        ThrowConfigError(
            absl::StrCat("line ", entry.line, ": unknown key ", entry.key));
      }
      if (!ReadEnvironment(EnvironmentName(flag)).empty()) continue;
      CLI::ConfigItem& item = found.emplace_back();
      item.name = entry.key;
      item.inputs = {entry.value};
    }
    return found;
  }

 private:
  const CLI::App& app_;
};

/// The words that CLI11 takes for true and false, in its order of reading.
bool IsTruthValue(const std::string& text) {
  constexpr std::array<absl::string_view, 8> kWords = {
      "true", "false", "1", "0", "yes", "no", "on", "off"};
  return absl::c_linear_search(kWords, text);
}

}  // namespace

FlagSet::FlagSet(CLI::App& app) : app_(app) {
  const std::string file = ReadEnvironment("ISOMATCH_CONFIG");
  app.set_config("--config", file,
                 "Reads flags from a file of lines KEY = VALUE; --print-config "
                 "writes one",
                 /*config_required=*/!file.empty())
      ->type_name("FILE (Env:ISOMATCH_CONFIG)");
  app.config_formatter(std::make_shared<ConfigFileReader>(app));
  app.allow_config_extras(CLI::config_extras_mode::error);
}

void FlagSet::AddText(const std::string& name, std::string& value,
                      const std::string& kind, const std::string& help) {
  Add({name, help, group_, [&value] { return QuoteConfigValue(value); }}, kind,
      value, TextReader(name, value));
}

void FlagSet::AddUrl(const std::string& name, std::string& value,
                     const std::string& kind, const std::string& help) {
  Add({name, help, group_,
       [&value] { return QuoteConfigValue(WithoutPassword(value)); }},
      kind, WithoutPassword(value), TextReader(name, value));
}

FlagSet::Read FlagSet::TextReader(const std::string& name, std::string& value) {
  return [&value, name](const std::string& text) {
    if (absl::c_any_of(text, absl::ascii_iscntrl)) {
      return WrongValue(name, "(text)", "no control characters");
    }
    value = text;
    return absl::OkStatus();
  };
}

void FlagSet::AddSwitch(const std::string& name, bool& value,
                        const std::string& help) {
  CLI::Option* const option = app_.add_flag(name, value, help);
  option->check(
      [](const std::string& text) {
        return IsTruthValue(text)
                   ? std::string()
                   : absl::StrCat(text, ", expected true or false");
      },
      /*validator_description=*/"");
  Finish({name, help, group_, [&value] { return value ? "true" : "false"; }},
         *option);
}

void FlagSet::AddCount(const std::string& name, int& value,
                       const IntRange& range, const std::string& help) {
  Add({name, absl::StrCat(help, "; ", FormatCounts(range)), group_,
       [&value] { return absl::StrCat(value); }},
      "NUMBER", absl::StrCat(value),
      [&value, name, range](const std::string& text) {
        std::int64_t count = 0;
        if (!absl::SimpleAtoi(text, &count)) {
          return WrongValue(name, text, FormatCounts(range));
        }
        absl::Status status = CheckCount(name, count, range);
        if (status.ok()) value = static_cast<int>(count);
        return status;
      });
}

void FlagSet::AddBytes(const std::string& name, std::int64_t& value,
                       const IntRange& range, const std::string& help) {
  Add({name, absl::StrCat(help, "; ", FormatBytes(range)), group_,
       [&value] { return QuoteConfigValue(FormatBytes(value)); }},
      "SIZE", FormatBytes(value),
      [&value, name, range](const std::string& text) {
        const auto bytes = ParseBytes(text);
        if (!bytes.ok()) return WrongValue(name, text, FormatBytes(range));
        value = *bytes;
        return CheckBytes(name, *bytes, range);
      });
}

void FlagSet::AddDuration(const std::string& name, absl::Duration& value,
                          const DurationRange& range, const std::string& help) {
  const auto print = [&value] { return absl::FormatDuration(value); };
  Add({name, absl::StrCat(help, "; ", FormatDurations(range)), group_,
       [print] { return QuoteConfigValue(print()); }},
      "TIME", print(), [&value, name, range](const std::string& text) {
        const auto duration = ParseDurationValue(text);
        if (!duration.ok()) {
          return WrongValue(name, text, FormatDurations(range));
        }
        value = *duration;
        return CheckDuration(name, *duration, range);
      });
}

void FlagSet::Add(const Flag& flag, const std::string& kind,
                  const std::string& value, const Read& read) {
  CLI::Option* const option = app_.add_option(
      flag.name,
      [read](const CLI::results_t& results) {
        const absl::Status status = read(results.front());
        if (status.ok()) return true;
        throw CLI::ValidationError(std::string(status.message()),
                                   CLI::ExitCodes::ValidationError);
      },
      flag.help);
  option->type_name(kind)->type_size(1)->expected(1)->default_str(value);
  Finish(flag, *option);
}

void FlagSet::Finish(const Flag& flag, CLI::Option& option) {
  option.group(flag.group)->envname(EnvironmentName(flag.name));
  flags_.push_back(flag);
}

std::string FlagSet::Print() const {
  std::string text;
  std::string group;
  for (const Flag& flag : flags_) {
    if (flag.group != group) {
      absl::StrAppend(&text, text.empty() ? "" : "\n", "# ", flag.group, "\n");
      group = flag.group;
    }
    absl::StrAppend(&text, "\n# ", flag.help, "\n", flag.name.substr(2), " = ",
                    flag.print(), "\n");
  }
  return text;
}

}  // namespace isomatch
