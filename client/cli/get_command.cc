#include <memory>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>

#include "absl/status/statusor.h"
#include "client/api/isomatch_client.h"
#include "client/cli/commands.h"
#include "client/cli/connection_flags.h"
#include "client/cli/job_text.h"
#include "client/cli/match_outputs.h"
#include "client/cli/option_support.h"
#include "client/cli/progress_display.h"
#include "client/cli/remote_server.h"
#include "client/files/mesh_file.h"
#include "core/base/status_macros.h"

namespace isomatch {
namespace {

constexpr char kGetFooter[] = R"(
Without files to write it prints what is known about the job. The files are those
of `match`; --precise needs the file of Y for its faces.

Examples:
  isomatch get jobs/4f1a...
  isomatch get jobs/4f1a... --wait -o map.txt --report report.json
  isomatch get jobs/4f1a... --precise points.txt --mesh-y Y.ply)";

struct GetArguments {
  std::string job;
  ConnectionFlags connection;
  MatchOutputs outputs;
  std::string mesh_y;
  bool wait = false;
  bool json = false;
};

absl::StatusOr<v1::Job> FindJob(const GetArguments& arguments,
                                IsomatchClient& client,
                                const Terminal& terminal) {
  const std::string name = FullJobName(arguments.job);
  if (!arguments.wait) return client.GetJob(name, terminal.stop);
  ProgressDisplay display(
      terminal.err, ProgressStyleFor(terminal.is_interactive, /*quiet=*/false));
  return client.Watch(
      name, [&](const v1::Job& job) { display.Show(job); }, terminal.stop);
}

absl::Status RunGet(const GetArguments& arguments, const Terminal& terminal) {
  ISOMATCH_RETURN_IF_ERROR(CheckOutputs(arguments.outputs, {arguments.mesh_y}));
  if (NeedColors(arguments.outputs)) {
    return absl::InvalidArgumentError(
        "a map in a .ply file shows both meshes, which `get` does not know: "
        "expected .txt, .npy or .json");
  }
  LoadedMesh y;
  if (!arguments.outputs.precise.empty()) {
    ISOMATCH_ASSIGN_OR_RETURN(y, ReadMesh(arguments.mesh_y, "--mesh-y"));
  }
  ISOMATCH_ASSIGN_OR_RETURN(
      const RemoteServer server,
      RemoteServer::Contact(arguments.connection, terminal));
  IsomatchClient client = server.client();
  const absl::StatusOr<v1::Job> job = FindJob(arguments, client, terminal);
  if (!job.ok()) return server.Explain(job.status());
  if (!HasFiles(arguments.outputs)) {
    ISOMATCH_RETURN_IF_ERROR(
        Print(arguments.json ? ToJsonLine(*job) : FormatJob(*job), terminal));
    return arguments.wait ? OutcomeOf(*job) : absl::OkStatus();
  }
  ISOMATCH_RETURN_IF_ERROR(OutcomeOf(*job));
  const absl::StatusOr<MatchResult> result =
      client.Fetch(*job, PartsFor(arguments.outputs), terminal.stop);
  if (!result.ok()) return server.Explain(result.status());
  Warn(ResultWarnings(result->info), terminal);
  TellVerdict(result->info.verdict(), /*quiet=*/false, terminal);
  return WriteOutputs(arguments.outputs,
                      {.mesh_y = &y.mesh, .warnings = y.warnings}, *result,
                      terminal);
}

}  // namespace

Command AddGetCommand(CLI::App& app) {
  CLI::App* command = app.add_subcommand(
      "get", "Prints what is known of a job, and fetches its result.");
  const auto arguments = std::make_shared<GetArguments>();
  arguments->outputs.map.clear();
  command->add_option("JOB", arguments->job, "Name, as `submit` printed it")
      ->required()
      ->type_name("");
  AddMatchOutputs(command, &arguments->outputs);
  CLI::Option* const mesh_y =
      command
          ->add_option("--mesh-y", arguments->mesh_y,
                       "The mesh Y, for the faces of --precise")
          ->type_name(kFile)
          ->group(kFilesGroup);
  command->get_option("--precise")->needs(mesh_y);
  AddConnectionFlags(command, &arguments->connection, ServerUse::kNeeded);
  command->add_flag("--wait", arguments->wait, "Watch the job until it ends");
  command->add_flag("--json", arguments->json, "Print the job as JSON");
  command->footer(kGetFooter);
  return {command, [arguments](const Terminal& terminal) {
            return RunGet(*arguments, terminal);
          }};
}

}  // namespace isomatch
