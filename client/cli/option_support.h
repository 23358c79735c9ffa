#pragma once

#include <cstdint>
#include <initializer_list>
#include <optional>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>

#include "absl/strings/string_view.h"

namespace isomatch {

// What options are called and how their values are checked. `--help`, the
// manual page and the completions of shells read it back from them.

/// Placeholders of values; those of files and folders are completed.
inline constexpr char kFile[] = "FILE";
inline constexpr char kFolder[] = "FOLDER";

/// Headings of `--help`, beside CLI11's own "Options".
inline constexpr char kFilesGroup[] = "Files to write";
inline constexpr char kMethodGroup[] = "Method";
inline constexpr char kServerGroup[] = "Server";

/// A check for options without a sign: CLI11 would take -1 for the largest.
CLI::Validator WholeNumber(std::uint64_t least, std::uint64_t most);

/// Makes bytes of "800MB" and "2GiB".
CLI::Validator MemorySize();

/// Lets `option` have one of `choices` only; `name` stands for it in the help.
CLI::Option* SetChoices(CLI::Option* option, const std::string& name,
                        const std::vector<std::string>& choices);

/// The choices of SetChoices; empty for any other option.
std::vector<std::string> ChoicesOf(const CLI::Option& option);

/// The placeholder of the option's value, without its choices and checks.
std::string PlaceholderOf(const CLI::Option& option);

/// Moves all options of `command` that `options` lists to a group of its help.
void SetGroup(CLI::App* command, const char* group,
              std::initializer_list<const char*> options);

/// The candidate that `word` was probably meant to be: it begins with `word`,
/// or differs by at most two letters (one in four, of long words) left out, too
/// many, wrong or exchanged with their neighbor. The nearest, of equals the
/// first.
std::optional<std::string> DidYouMean(
    absl::string_view word, const std::vector<std::string>& candidates);

}  // namespace isomatch
