#pragma once

#include <functional>

#include <CLI/CLI.hpp>

#include "absl/status/status.h"
#include "client/command_line.h"

namespace isomatch {

/// A subcommand, to be run after parsing when the user named it.
/// INVALID_ARGUMENT and NOT_FOUND mean wrong usage or input.
struct Command {
  CLI::App* app;
  std::function<absl::Status(const Terminal&)> run;
};

/// Each adds one subcommand with its options and help to `app`.
Command AddMatchCommand(CLI::App& app);
Command AddEvaluateCommand(CLI::App& app);
Command AddTransferCommand(CLI::App& app);
Command AddInspectCommand(CLI::App& app);
Command AddSampleCommand(CLI::App& app);

}  // namespace isomatch
