#include <memory>
#include <string>
#include <utility>
#include <vector>

#include <CLI/CLI.hpp>
#include <nlohmann/json.hpp>

#include "absl/status/statusor.h"
#include "client/api/isomatch_client.h"
#include "client/cli/command_support.h"
#include "client/cli/commands.h"
#include "client/cli/connection_flags.h"
#include "client/cli/embedded_server.h"
#include "client/cli/option_support.h"
#include "client/cli/remote_server.h"
#include "client/files/mesh_file.h"
#include "client/files/mesh_input.h"
#include "client/inspect/inspection_report.h"
#include "core/base/status_macros.h"

namespace isomatch {
namespace {

using Json = nlohmann::ordered_json;

constexpr char kInspectFooter[] = R"(
Tells what a mesh file holds, what cleaning will do to it, what a match will
cost and what may harm it. Components, rims and genus are those of the surface
as it is matched: seams joined, damaged faces left out.

Time is about what two cores take for two meshes of this size; memory is the
upper bound that the server reserves. Whether it would accept the mesh is said
for --server, else for a server of this machine with its defaults.

A file that cannot be read is reported, and the others are inspected; the exit
status is then 2.

Examples:
  isomatch inspect cat.off
  isomatch inspect scans/*.ply --json | jq '.meshes[] | .path, .warnings'
  isomatch inspect cat.off --server meshes.example.org:7443 --tls-ca ca.crt)";

struct InspectArguments {
  std::vector<std::string> meshes;
  std::string weld;
  ConnectionFlags connection;
  bool json = false;
};

absl::StatusOr<v1::GetServerInfoResponse> AskEmbedded(
    const std::stop_token& stop) {
  ISOMATCH_ASSIGN_OR_RETURN(const std::unique_ptr<Server> server,
                            StartEmbeddedServer());
  return IsomatchClient(server->InProcessChannel()).GetServerInfo(stop);
}

absl::StatusOr<v1::GetServerInfoResponse> AskServer(
    const ConnectionFlags& connection, const Terminal& terminal) {
  if (connection.server.empty()) return AskEmbedded(terminal.stop);
  ISOMATCH_ASSIGN_OR_RETURN(const RemoteServer server,
                            RemoteServer::Open(connection, terminal));
  absl::StatusOr<v1::GetServerInfoResponse> info =
      IsomatchClient(server.channel()).GetServerInfo(terminal.stop);
  if (info.ok()) return info;
  return server.Explain(info.status());
}

absl::StatusOr<InspectionReport> Inspect(
    const std::string& path, const std::string& weld,
    const v1::GetServerInfoResponse& server) {
  ISOMATCH_ASSIGN_OR_RETURN(LoadedMesh loaded,
                            LoadMeshFile(path, "MESH", weld));
  InspectionReport report;
  report.path = path;
  report.format = std::move(loaded.format);
  report.reading = std::move(loaded.warnings);
  report.mesh = InspectMesh(loaded.mesh);
  ISOMATCH_ASSIGN_OR_RETURN(report.cost, EstimateCost(loaded.mesh, server));
  return report;
}

/// Prints the text of an inspection, or adds its JSON to `meshes`.
absl::Status Show(const InspectionReport& report, bool as_json,
                  const Terminal& terminal, Json& meshes) {
  if (!as_json) return Print(FormatInspection(report), terminal);
  meshes.push_back(InspectionJson(report));
  return absl::OkStatus();
}

absl::Status RunInspect(const InspectArguments& arguments,
                        const Terminal& terminal) {
  ISOMATCH_ASSIGN_OR_RETURN(const v1::GetServerInfoResponse server,
                            AskServer(arguments.connection, terminal));
  absl::Status worst;
  Json meshes = Json::array();
  for (const std::string& path : arguments.meshes) {
    if (terminal.stop.stop_requested()) {
      return absl::CancelledError("interrupted");
    }
    const absl::StatusOr<InspectionReport> report =
        Inspect(path, arguments.weld, server);
    if (report.ok()) {
      ISOMATCH_RETURN_IF_ERROR(Show(*report, arguments.json, terminal, meshes));
      continue;
    }
    // The caller prints the last error.
    if (!worst.ok()) {
      terminal.err << "isomatch: " << worst.message() << std::endl;
    }
    worst = report.status();
    meshes.push_back({{"path", path}, {"error", std::string(worst.message())}});
  }
  if (arguments.json) {
    ISOMATCH_RETURN_IF_ERROR(
        PrintJson({{"meshes", std::move(meshes)}}, terminal));
  }
  return worst;
}

}  // namespace

Command AddInspectCommand(CLI::App& app) {
  CLI::App* command = app.add_subcommand(
      "inspect",
      "Shows what is in mesh files and what a match will make of it.");
  const auto arguments = std::make_shared<InspectArguments>();
  command
      ->add_option("MESH", arguments->meshes,
                   "Meshes: .off, .obj, .ply or .stl")
      ->required()
      ->type_name(kFile);
  AddWeldOption(command, &arguments->weld);
  AddConnectionFlags(command, &arguments->connection, ServerUse::kOptional);
  command->add_flag("--json", arguments->json, "Print JSON instead of text");
  command->footer(kInspectFooter);
  return {command, [arguments](const Terminal& terminal) {
            return RunInspect(*arguments, terminal);
          }};
}

}  // namespace isomatch
