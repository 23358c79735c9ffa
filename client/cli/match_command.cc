#include <algorithm>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <CLI/CLI.hpp>

#include "absl/status/statusor.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "client/api/isomatch_client.h"
#include "client/cli/commands.h"
#include "client/cli/connection_flags.h"
#include "client/cli/embedded_server.h"
#include "client/cli/job_flags.h"
#include "client/cli/match_outputs.h"
#include "client/cli/progress_display.h"
#include "client/cli/remote_server.h"
#include "client/job/match_files.h"
#include "client/job/match_report.h"
#include "core/base/status_macros.h"

namespace isomatch {
namespace {

constexpr char kMatchFooter[] = R"(
MAP has one line for each vertex of X, in the order of X's file: the 0-based
vertex of Y that it corresponds to, or -1 for a vertex without a counterpart: one
on no face and, with --relation part-of-x or overlap, one that Y lacks. Its
extension tells the format: .txt or none is text, .npy the same as a NumPy array of
int64, .json as JSON, .ply is X in the colors of Y, to be looked at. Without -o the
map goes to standard output; where that is a terminal, a summary does instead,
unless -o - asks for the numbers.

Without --server the work is done in this process, by the same server code.

Examples:
  isomatch match X.off Y.ply -o map.txt
  isomatch match X.off Y.ply -o map.txt --report report.json
  isomatch match X.off Y.ply -o map.txt --json | jq .symmetry_confidence
  isomatch match X.off Y.ply --landmarks pairs.txt --no-progress > map.txt
  isomatch match X.off Y.ply --landmarks-x X.mrk.json --landmarks-y Y.mrk.json \
                 -o map.txt
  isomatch match X.off Y.ply -o map.npy
  zcat X.off.gz | isomatch match - Y.glb -o map.txt
  isomatch match X.off Y.ply -o colored.ply --confidence confidence.txt
  isomatch match X.off Y.ply -o map.txt --server 127.0.0.1:7443
  isomatch match X.off Y.ply -o map.txt --precise points.txt
  isomatch match X.off Y.ply -o map.txt --relation overlap --mask-y mask.txt
  isomatch match X.off Y.ply -o map.txt --server meshes.example.org:7443 \
                 --tls-ca ca.crt --api-key-file alice.key

A landmark file has lines `x y` of 0-based vertices known to match; # starts a
comment. One that the rest of the map contradicts is changed, and a warning says
so; --landmarks-exact keeps all as they are. --landmarks-x and --landmarks-y take
points in space instead, of 3D Slicer or lines `x y z`, in the coordinates of the
mesh's file. Each goes to the surface's nearest place and its nearest vertex; a
line says how far that was.

Further files, one line for each vertex of X:
  --precise      FACE W0 W1 W2: a 0-based face of Y and the weights of its three
                 vertices in the file's order, sum 1; -1 0 0 0 for no place
  --confidence   0 (do not trust its line of MAP) to 1
  --alternative  as MAP: the best of the maps that were not chosen; no file, but
                 a warning, when no other came near
--mask-y has a line for each vertex of Y: 1 where X has a counterpart, else 0.
--functional-map has the eigenvalues of both meshes and, by rows, the matrix
that carries eigenfunctions of Y (columns) to X (rows).)";

struct MatchArguments {
  std::string x;
  std::string y;
  LandmarkPaths landmarks;
  ConnectionFlags connection;
  JobOptions job;
  MatchOutputs outputs;
  bool no_progress = false;
  bool json = false;
  /// Tell a person about the map in place of printing it.
  bool is_summary = false;
};

absl::StatusOr<MatchResult> RequestMatch(IsomatchClient client,
                                         const MatchRequest& request,
                                         const MatchArguments& arguments,
                                         const Terminal& terminal) {
  ProgressDisplay display(
      terminal.err,
      ProgressStyleFor(terminal.is_interactive, arguments.no_progress));
  return client.Match(
      request, [&](const v1::Job& job) { display.Show(job); }, terminal.stop);
}

absl::StatusOr<MatchResult> RunRemote(const MatchRequest& request,
                                      const RemoteServer& server,
                                      const MatchArguments& arguments,
                                      const Terminal& terminal) {
  absl::StatusOr<MatchResult> result =
      RequestMatch(server.client(), request, arguments, terminal);
  if (result.ok()) return result;
  return server.Explain(result.status());
}

absl::StatusOr<MatchResult> RunEmbedded(const MatchRequest& request,
                                        const MatchArguments& arguments,
                                        const Terminal& terminal) {
  ISOMATCH_ASSIGN_OR_RETURN(const std::unique_ptr<Server> server,
                            StartEmbeddedServer(
                                /*workers=*/1, arguments.job.threads));
  return RequestMatch(ClientOf(server.get()), request, arguments, terminal);
}

// For a terminal that got no map.
std::string FormatSummary(const MatchResult& result) {
  const auto unmatched =
      std::count(result.y_from_x.begin(), result.y_from_x.end(), kNoVertex);
  return absl::StrFormat(
      "%d of %d vertices of X have a place on Y, mean confidence %.2f, "
      "coverage of Y %.2f\n"
      "the map was not written: -o map.txt writes it, -o - prints it\n",
      static_cast<std::int64_t>(result.y_from_x.size()) - unmatched,
      result.y_from_x.size(), result.info.quality().mean_confidence(),
      result.info.quality().coverage());
}

// Keeps the colors of Y where a map is to have them.
void SetColors(const MatchArguments& arguments,
               absl::StatusOr<std::optional<Colors>> colors, MeshFacts* facts) {
  if (!NeedColors(arguments.outputs)) return;
  if (colors.ok()) {
    facts->colors_y = *std::move(colors);
  } else {
    facts->warnings.push_back(
        absl::StrCat("Y has the colors of places: its own cannot be read: ",
                     colors.status().message()));
  }
}

absl::Status MatchAndWrite(const MatchArguments& arguments,
                           const Terminal& terminal) {
  ISOMATCH_RETURN_IF_ERROR(CheckOutputs(
      arguments.outputs,
      {arguments.x, arguments.y, arguments.landmarks.pairs,
       arguments.landmarks.points_x, arguments.landmarks.points_y}));
  if (arguments.json &&
      (arguments.outputs.map == "-" || arguments.is_summary)) {
    return absl::InvalidArgumentError(
        "--json: the map goes to standard output, expected -o FILE");
  }
  std::optional<RemoteServer> server;
  if (!arguments.connection.server.empty()) {
    ISOMATCH_ASSIGN_OR_RETURN(
        server, RemoteServer::Open(arguments.connection, terminal));
  }
  MatchRequest request;
  std::vector<std::string> warnings;
  ISOMATCH_ASSIGN_OR_RETURN(
      FileOfY file_y, ReadMatchFiles({arguments.x, arguments.y,
                                      arguments.landmarks, arguments.job.weld},
                                     &request, &warnings));
  MeshFacts facts = {.mesh_x = &request.mesh_x,
                     .mesh_y = &file_y.MeshIn(request),
                     .warnings = warnings};
  SetColors(arguments, std::move(file_y.colors), &facts);
  SetJobOptions(arguments.job, &request);
  if (!server) request.threads = ThreadsHere(request.threads);
  request.parts = PartsFor(arguments.outputs);
  if (!arguments.no_progress) Tell(file_y.notes, terminal);
  Warn(facts.warnings, terminal);
  const absl::StatusOr<MatchResult> found =
      server ? RunRemote(request, *server, arguments, terminal)
             : RunEmbedded(request, arguments, terminal);
  if (!found.ok()) return InFlagWords(found.status());
  const MatchResult& result = *found;
  Warn(ResultWarnings(result.info), terminal);
  TellVerdict(result.info.verdict(), arguments.no_progress, terminal);
  ISOMATCH_RETURN_IF_ERROR(
      WriteOutputs(arguments.outputs, facts, result, terminal));
  if (arguments.is_summary) return Print(FormatSummary(result), terminal);
  if (!arguments.json) return absl::OkStatus();
  return Print(FormatReport(result, facts.warnings), terminal);
}

}  // namespace

Command AddMatchCommand(CLI::App& app) {
  CLI::App* command = app.add_subcommand(
      "match", "Finds for every vertex of mesh X its place on mesh Y.");
  const auto arguments = std::make_shared<MatchArguments>();
  AddPairOptions(command, &arguments->x, &arguments->y, &arguments->landmarks);
  AddMatchOutputs(command, &arguments->outputs);
  AddConnectionFlags(command, &arguments->connection, ServerUse::kOptional);
  AddJobFlags(command, &arguments->job);
  command->add_flag("--no-progress", arguments->no_progress,
                    "Say nothing on standard error but warnings and errors");
  command->add_flag("--json", arguments->json,
                    "Print the report as JSON; needs -o");
  command->footer(kMatchFooter);
  return {command, [arguments, command](const Terminal& terminal) {
            if (terminal.out_is_terminal && command->count("--output") == 0) {
              arguments->outputs.map.clear();
              arguments->is_summary = true;
            }
            return MatchAndWrite(*arguments, terminal);
          }};
}

}  // namespace isomatch
