#include "client/cli/command_line.h"

#include <algorithm>
#include <exception>
#include <memory>
#include <new>
#include <optional>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>

#include "absl/strings/str_cat.h"
#include "client/cli/commands.h"
#include "client/cli/option_support.h"
#include "core/base/version.h"

namespace isomatch {
namespace {

constexpr char kProgramFooter[] = R"(
Examples:
  isomatch match cat.off dog.off -o map.txt
  isomatch batch pairs.txt -o maps
  isomatch inspect cat.off dog.off
  isomatch transfer cat.off dog.obj map.txt -o textured_cat.obj
  isomatch submit cat.off dog.off --server 127.0.0.1:7443
  isomatch evaluate dog.off map.txt truth.txt
  isomatch sample --pose A --vertices 5000 -o a.off
  isomatch view cat.off dog.off map.txt -o report.html

`isomatch help COMMAND` tells more about each command. The environment's
ISOMATCH_SERVER stands for --server.
Exit status: 0 success, 2 wrong usage or input, 1 any other failure,
130 interrupted.)";

int ExitStatus(const absl::Status& status, const std::stop_token& stop) {
  switch (status.code()) {
    case absl::StatusCode::kOk:
      return kExitSuccess;
    case absl::StatusCode::kInvalidArgument:
    case absl::StatusCode::kNotFound:
      return kExitUsage;
    case absl::StatusCode::kCancelled:
      return stop.stop_requested() ? kExitInterrupted : kExitFailure;
    default:
      return kExitFailure;
  }
}

int Report(const absl::Status& status, const Terminal& terminal) {
  if (!status.ok()) {
    terminal.err << "isomatch: " << status.message() << std::endl;
  }
  return ExitStatus(status, terminal.stop);
}

int RunParsed(const std::vector<Command>& commands, const Terminal& terminal) {
  for (const Command& command : commands) {
    if (command.app->parsed()) return Report(command.run(terminal), terminal);
  }
  return kExitUsage;  // not reached: one subcommand is required
}

std::vector<std::string> NamesOf(const CLI::App& app) {
  std::vector<std::string> names;
  for (const CLI::App* command :
       app.get_subcommands([](const CLI::App*) { return true; })) {
    names.push_back(command->get_name());
  }
  return names;
}

std::vector<std::string> OptionNamesOf(const CLI::App& command) {
  std::vector<std::string> names;
  for (const CLI::Option* option : command.get_options()) {
    for (const std::string& name : option->get_lnames()) {
      names.push_back("--" + name);
    }
  }
  return names;
}

std::string Suggestion(const std::string& word,
                       const std::vector<std::string>& candidates) {
  const std::optional<std::string> meant = DidYouMean(word, candidates);
  return meant ? absl::StrCat(", did you mean '", *meant, "'?") : "";
}

// What is wrong with the words that a command did not expect, in their order;
// "" when there are none.
std::string AboutUnexpected(const CLI::App& app, const CLI::App* command) {
  const std::vector<std::string> words =
      command == nullptr ? app.remaining() : command->remaining();
  if (words.empty()) return "";
  const auto is_option = [](const std::string& word) {
    return word.size() > 1 && word[0] == '-';
  };
  if (command == nullptr && !is_option(words[0])) {
    return absl::StrCat("there is no command '", words[0], "'",
                        Suggestion(words[0], NamesOf(app)));
  }
  const auto option = std::find_if(words.begin(), words.end(), is_option);
  if (option != words.end()) {
    const std::string name = option->substr(0, option->find('='));
    return absl::StrCat(
        "there is no option '", name, "'",
        Suggestion(name, OptionNamesOf(command == nullptr ? app : *command)));
  }
  return absl::StrCat("'", words[0], "' is one file or word too many");
}

int ReportUsage(const CLI::App& app, const CLI::ParseError& error,
                const Terminal& terminal) {
  const std::vector<CLI::App*> parsed = app.get_subcommands();
  const CLI::App* command = parsed.empty() ? nullptr : parsed.front();
  const std::string name = command == nullptr
                               ? "isomatch"
                               : absl::StrCat("isomatch ", command->get_name());
  std::string what = AboutUnexpected(app, command);
  if (what.empty()) {
    what = command == nullptr ? "expected a command" : error.what();
  }
  terminal.err << name << ": " << what << "\n`" << name
               << " --help` tells more." << std::endl;
  return kExitUsage;
}

// Prints the help that it is called for.
absl::Status PrintHelp(const CLI::App& app, const std::string& name,
                       const Terminal& terminal) {
  if (name.empty()) {
    // app.help() would be that of the command that was given: this one.
    return Print(app.get_formatter()->make_help(&app, app.get_name(),
                                                CLI::AppFormatMode::Normal),
                 terminal);
  }
  const std::vector<std::string> names = NamesOf(app);
  if (std::find(names.begin(), names.end(), name) == names.end()) {
    return absl::InvalidArgumentError(absl::StrCat(
        "there is no command '", name, "'", Suggestion(name, names)));
  }
  return Print(app.get_subcommand(name)->help("isomatch"), terminal);
}

Command AddHelpCommand(CLI::App& app) {
  CLI::App* command = app.add_subcommand(
      "help", "Prints the help of a command, as its --help does.");
  const auto name = std::make_shared<std::string>();
  command->add_option("COMMAND", *name, "One of `isomatch help`")
      ->type_name("");
  return {command, [&app, name](const Terminal& terminal) {
            return PrintHelp(app, *name, terminal);
          }};
}

}  // namespace

int RunCommandLine(int argc, const char* const* argv,
                   const Terminal& terminal) {
  CLI::App app("Dense correspondences between near-isometric 3D meshes.",
               "isomatch");
  app.set_version_flag("--version", std::string("isomatch ") + kVersion);
  app.footer(kProgramFooter);
  app.require_subcommand(1);
  const std::vector<Command> commands = {
      AddMatchCommand(app),    AddBatchCommand(app),
      AddEvaluateCommand(app), AddSampleCommand(app),
      AddSubmitCommand(app),   AddWatchCommand(app),
      AddGetCommand(app),      AddListCommand(app),
      AddCancelCommand(app),   AddDeleteCommand(app),
      AddUploadCommand(app),   AddInfoCommand(app),
      AddViewCommand(app),     AddTransferCommand(app),
      AddInspectCommand(app),  AddCompletionCommand(app),
      AddManCommand(app),      AddHelpCommand(app)};
  // CLI11 reports by exceptions; memory can run out on huge files.
  try {
    app.parse(argc, argv);
    return RunParsed(commands, terminal);
  } catch (const CLI::ParseError& error) {
    if (error.get_exit_code() != 0) return ReportUsage(app, error, terminal);
    app.exit(error, terminal.out, terminal.err);  // --help, --version
    return kExitSuccess;
  } catch (const std::bad_alloc&) {
    return Report(absl::ResourceExhaustedError("out of memory"), terminal);
  }
}

}  // namespace isomatch
