#pragma once

#include <string>

namespace CLI {
class App;
}  // namespace CLI

namespace isomatch {

// Texts about a command line, made from its own description: its subcommands,
// their options and footers.

/// A script that completes commands, options and files in bash, zsh or fish.
std::string BashCompletion(const CLI::App& app);
std::string ZshCompletion(const CLI::App& app);
std::string FishCompletion(const CLI::App& app);

/// The manual page, as man(7) reads it.
std::string ManPage(const CLI::App& app, const std::string& version);

}  // namespace isomatch
