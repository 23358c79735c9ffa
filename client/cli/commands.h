#pragma once

#include <functional>

#include "absl/status/status.h"
#include "client/cli/terminal.h"

namespace CLI {
class App;
}  // namespace CLI

namespace isomatch {

/// A subcommand, to be run after parsing when the user named it.
/// INVALID_ARGUMENT and NOT_FOUND mean wrong usage or input.
struct Command {
  CLI::App* app;
  std::function<absl::Status(const Terminal&)> run;
};

/// Each adds one subcommand with its options and help to `app`.
Command AddMatchCommand(CLI::App& app);
Command AddBatchCommand(CLI::App& app);
Command AddSubmitCommand(CLI::App& app);
Command AddWatchCommand(CLI::App& app);
Command AddGetCommand(CLI::App& app);
Command AddListCommand(CLI::App& app);
Command AddCancelCommand(CLI::App& app);
Command AddDeleteCommand(CLI::App& app);
Command AddUploadCommand(CLI::App& app);
Command AddInfoCommand(CLI::App& app);
Command AddCompletionCommand(CLI::App& app);
Command AddManCommand(CLI::App& app);
Command AddEvaluateCommand(CLI::App& app);
Command AddTransferCommand(CLI::App& app);
Command AddInspectCommand(CLI::App& app);
Command AddSampleCommand(CLI::App& app);
Command AddViewCommand(CLI::App& app);

}  // namespace isomatch
