#include <memory>
#include <string>

#include <CLI/CLI.hpp>

#include "client/cli/commands.h"
#include "client/cli/shell_texts.h"
#include "core/base/version.h"

namespace isomatch {
namespace {

constexpr char kCompletionFooter[] = R"(
Examples:
  isomatch completion bash > ~/.local/share/bash-completion/completions/isomatch
  isomatch completion zsh > "${fpath[1]}/_isomatch"
  isomatch completion fish > ~/.config/fish/completions/isomatch.fish)";

constexpr char kManFooter[] = R"(
Example:
  isomatch man > isomatch.1 && man ./isomatch.1)";

}  // namespace

Command AddCompletionCommand(CLI::App& app) {
  CLI::App* command = app.add_subcommand(
      "completion", "Prints a script that completes commands in your shell.");
  const auto shell = std::make_shared<std::string>();
  command->add_option("SHELL", *shell, "bash, zsh or fish")
      ->check(CLI::IsMember({"bash", "zsh", "fish"}))
      ->required();
  command->footer(kCompletionFooter);
  return {command, [&app, shell](const Terminal& terminal) {
            return Print(*shell == "bash"  ? BashCompletion(app)
                         : *shell == "zsh" ? ZshCompletion(app)
                                           : FishCompletion(app),
                         terminal);
          }};
}

Command AddManCommand(CLI::App& app) {
  CLI::App* command =
      app.add_subcommand("man", "Prints the manual page, for man(1).");
  command->footer(kManFooter);
  return {command, [&app](const Terminal& terminal) {
            return Print(ManPage(app, kVersion), terminal);
          }};
}

}  // namespace isomatch
