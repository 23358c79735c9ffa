#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/time/time.h"
#include "server/config/config_values.h"

namespace CLI {
class App;
class Option;
}  // namespace CLI

namespace isomatch {

/// Flags that can also be set by a file and by the environment. The value of
/// --max-queued-jobs is, from the first of these that has it,
///
///   1. on the command line:   --max-queued-jobs 50
///   2. in the environment:    ISOMATCH_MAX_QUEUED_JOBS=50  (empty is none)
///   3. in the file that --config or ISOMATCH_CONFIG names:
///                             max-queued-jobs = 50
///   4. what the variable held when the flag was added.
///
/// Wrong values and keys make App::parse throw a CLI::ParseError, which names
/// field, value and range. Each variable must outlive the CLI::App.
class FlagSet {
 public:
  /// Adds --config to `app`. REQUIRES: nothing else reads a file for it.
  explicit FlagSet(CLI::App& app);

  /// The flags that follow stand under this heading in --help.
  void BeginGroup(const std::string& group) { group_ = group; }

  /// `help` says what it is, `kind` stands for the value, e.g. "FILE".
  void AddText(const std::string& name, std::string& value,
               const std::string& kind, const std::string& help);
  /// A text whose password, if it has one, Print leaves out.
  void AddUrl(const std::string& name, std::string& value,
              const std::string& kind, const std::string& help);
  void AddSwitch(const std::string& name, bool& value, const std::string& help);
  void AddCount(const std::string& name, int& value, const IntRange& range,
                const std::string& help);
  void AddBytes(const std::string& name, std::int64_t& value,
                const IntRange& range, const std::string& help);
  void AddDuration(const std::string& name, absl::Duration& value,
                   const DurationRange& range, const std::string& help);

  /// Returns all flags with the values they have now, as a file for --config.
  std::string Print() const;

 private:
  struct Flag {
    std::string name;
    std::string help;
    std::string group;
    /// The value as the file has it.
    std::function<std::string()> print;
  };
  using Read = std::function<absl::Status(const std::string& text)>;

  static Read TextReader(const std::string& name, std::string& value);

  /// Adds a flag with a value; `read` sets the variable.
  void Add(const Flag& flag, const std::string& kind, const std::string& value,
           const Read& read);

  /// What all flags have in common.
  void Finish(const Flag& flag, CLI::Option& option);

  CLI::App& app_;
  std::string group_;
  std::vector<Flag> flags_;
};

}  // namespace isomatch
