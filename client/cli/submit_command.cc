#include <memory>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>
#include <nlohmann/json.hpp>

#include "absl/status/statusor.h"
#include "absl/strings/str_cat.h"
#include "client/api/isomatch_client.h"
#include "client/cli/command_support.h"
#include "client/cli/commands.h"
#include "client/cli/connection_flags.h"
#include "client/cli/job_flags.h"
#include "client/cli/job_text.h"
#include "client/cli/option_support.h"
#include "client/cli/remote_server.h"
#include "client/files/mesh_file.h"
#include "client/files/mesh_input.h"
#include "client/job/match_files.h"
#include "core/base/status_macros.h"

namespace isomatch {
namespace {

constexpr char kSubmitFooter[] = R"(
Prints the job's name and returns as soon as the server has it on disk. The job
goes on when nobody watches.

Examples:
  isomatch submit X.off Y.ply --label study=spring
  job=$(isomatch submit X.off Y.ply) && isomatch get $job --wait -o map.txt
  isomatch submit X.off Y.ply --functional-map --queue-timeout 1h --json)";

constexpr char kUploadFooter[] = R"(
Jobs bring their meshes themselves, and only those that the server lacks. Sending
a template ahead saves the first of them the time. Prints SHA-256 and file.

Example:
  isomatch upload template.off scans/*.ply)";

struct SubmitArguments {
  std::string x;
  std::string y;
  LandmarkPaths landmarks;
  ConnectionFlags connection;
  JobOptions job;
  QueueFlags queue;
  bool functional_map = false;
  bool json = false;
};

absl::Status RunSubmit(const SubmitArguments& arguments,
                       const Terminal& terminal) {
  ISOMATCH_ASSIGN_OR_RETURN(const RemoteServer server,
                            RemoteServer::Open(arguments.connection, terminal));
  MatchRequest request;
  std::vector<std::string> warnings;
  ISOMATCH_RETURN_IF_ERROR(SetQueueFlags(arguments.queue, &request));
  SetJobOptions(arguments.job, &request);
  ISOMATCH_ASSIGN_OR_RETURN(
      const FileOfY file_y,
      ReadMatchFiles(
          {arguments.x, arguments.y, arguments.landmarks, arguments.job.weld},
          &request, &warnings));
  Tell(file_y.notes, terminal);
  if (arguments.functional_map) {
    request.parts = {v1::RESULT_PART_FUNCTIONAL_MAP};
  }
  Warn(warnings, terminal);
  const absl::StatusOr<v1::Job> job =
      server.client().Submit(request, terminal.stop);
  if (!job.ok()) return InFlagWords(server.Explain(job.status()));
  return Print(arguments.json ? ToJsonLine(*job) : job->name() + "\n",
               terminal);
}

struct UploadArguments {
  std::vector<std::string> meshes;
  std::string weld;
  ConnectionFlags connection;
  bool json = false;
};

std::string FormatUpload(const std::string& path, const v1::Digest& digest,
                         bool known, bool json) {
  if (!json) {
    return absl::StrCat(digest.sha256(), "  ", path, known ? "  (known)" : "",
                        "\n");
  }
  return nlohmann::ordered_json({{"path", path},
                                 {"sha256", digest.sha256()},
                                 {"size_bytes", digest.size_bytes()},
                                 {"known", known}})
             .dump(-1, ' ', /*ensure_ascii=*/false,
                   nlohmann::ordered_json::error_handler_t::replace) +
         "\n";
}

absl::Status RunUpload(const UploadArguments& arguments,
                       const Terminal& terminal) {
  ISOMATCH_ASSIGN_OR_RETURN(const RemoteServer server,
                            RemoteServer::Open(arguments.connection, terminal));
  IsomatchClient client = server.client();
  for (const std::string& path : arguments.meshes) {
    ISOMATCH_ASSIGN_OR_RETURN(const LoadedMesh loaded,
                              LoadMeshFile(path, "MESH", arguments.weld));
    Warn(loaded.warnings, terminal);
    v1::Digest digest;
    const absl::StatusOr<bool> known =
        client.UploadMesh(loaded.mesh, &digest, terminal.stop);
    if (!known.ok()) return server.Explain(known.status());
    ISOMATCH_RETURN_IF_ERROR(
        Print(FormatUpload(path, digest, *known, arguments.json), terminal));
  }
  return absl::OkStatus();
}

}  // namespace

Command AddSubmitCommand(CLI::App& app) {
  CLI::App* command = app.add_subcommand(
      "submit", "Sends a job to a server and returns its name.");
  const auto arguments = std::make_shared<SubmitArguments>();
  AddPairOptions(command, &arguments->x, &arguments->y, &arguments->landmarks);
  AddConnectionFlags(command, &arguments->connection, ServerUse::kNeeded);
  AddJobFlags(command, &arguments->job);
  AddQueueFlags(command, &arguments->queue);
  command->add_flag("--functional-map", arguments->functional_map,
                    "Compute the functional map, for `get` to fetch");
  command->add_flag("--json", arguments->json, "Print the job as JSON");
  command->footer(kSubmitFooter);
  return {command, [arguments](const Terminal& terminal) {
            return RunSubmit(*arguments, terminal);
          }};
}

Command AddUploadCommand(CLI::App& app) {
  CLI::App* command =
      app.add_subcommand("upload", "Sends meshes ahead of their jobs.");
  const auto arguments = std::make_shared<UploadArguments>();
  command
      ->add_option("MESH", arguments->meshes,
                   absl::StrCat("Mesh: ", kMeshFiles))
      ->required()
      ->type_name(kFile);
  AddWeldOption(command, &arguments->weld);
  AddConnectionFlags(command, &arguments->connection, ServerUse::kNeeded);
  command->add_flag("--json", arguments->json,
                    "Print each mesh as JSON in a line of its own");
  command->footer(kUploadFooter);
  return {command, [arguments](const Terminal& terminal) {
            return RunUpload(*arguments, terminal);
          }};
}

}  // namespace isomatch
