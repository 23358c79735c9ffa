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
  return ClientOf(server.get()).GetServerInfo(stop);
}

absl::StatusOr<v1::GetServerInfoResponse> AskServer(
    const ConnectionFlags& connection, const Terminal& terminal) {
  if (connection.server.empty()) return AskEmbedded(terminal.stop);
  ISOMATCH_ASSIGN_OR_RETURN(const RemoteServer server,
                            RemoteServer::Open(connection, terminal));
  absl::StatusOr<v1::GetServerInfoResponse> info =
      server.client().GetServerInfo(terminal.stop);
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

/// What the files told: JSON of each, and the error of the last bad one.
struct Inspections {
  Json meshes = Json::array();
  absl::Status last_error;
};

/// Inspects one file of several. That it cannot be read is no error of this
/// function; an interruption is, and an output that cannot be written.
absl::Status InspectOne(const std::string& path,
                        const InspectArguments& arguments,
                        const v1::GetServerInfoResponse& server,
                        const Terminal& terminal, Inspections& inspections) {
  if (terminal.stop.stop_requested()) {
    return absl::CancelledError("interrupted");
  }
  const absl::StatusOr<InspectionReport> report =
      Inspect(path, arguments.weld, server);
  if (report.ok()) {
    return Show(*report, arguments.json, terminal, inspections.meshes);
  }
  // The command ends with the last error; the others are printed here.
  absl::Status& error = inspections.last_error;
  if (!error.ok()) terminal.err << "isomatch: " << error.message() << std::endl;
  error = report.status();
  inspections.meshes.push_back(
      {{"path", path}, {"error", std::string(error.message())}});
  return absl::OkStatus();
}

absl::Status RunInspect(const InspectArguments& arguments,
                        const Terminal& terminal) {
  ISOMATCH_ASSIGN_OR_RETURN(const v1::GetServerInfoResponse server,
                            AskServer(arguments.connection, terminal));
  Inspections inspections;
  for (const std::string& path : arguments.meshes) {
    ISOMATCH_RETURN_IF_ERROR(
        InspectOne(path, arguments, server, terminal, inspections));
  }
  if (arguments.json) {
    ISOMATCH_RETURN_IF_ERROR(
        PrintJson({{"meshes", std::move(inspections.meshes)}}, terminal));
  }
  return inspections.last_error;
}

}  // namespace

Command AddInspectCommand(CLI::App& app) {
  CLI::App* command = app.add_subcommand(
      "inspect",
      "Shows what is in mesh files and what a match will make of it.");
  const auto arguments = std::make_shared<InspectArguments>();
  command
      ->add_option("MESH", arguments->meshes,
                   absl::StrCat("Meshes: ", kMeshFiles))
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
