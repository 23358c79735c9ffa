#include "client/command_line.h"

#include <exception>
#include <new>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>

#include "client/commands.h"
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

`isomatch COMMAND --help` tells more about each command. The environment's
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
      AddManCommand(app)};
  // CLI11 reports by exceptions; memory can run out on huge files.
  try {
    app.parse(argc, argv);
    return RunParsed(commands, terminal);
  } catch (const CLI::ParseError& error) {
    const int code = app.exit(error, terminal.out, terminal.err);
    return code == 0 ? kExitSuccess : kExitUsage;
  } catch (const std::bad_alloc&) {
    return Report(absl::ResourceExhaustedError("out of memory"), terminal);
  }
}

}  // namespace isomatch
