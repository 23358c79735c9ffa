#include <cstdint>
#include <cstdlib>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "absl/status/statusor.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "client/command_support.h"
#include "client/commands.h"
#include "client/connection.h"
#include "client/connection_flags.h"
#include "client/isomatch_client.h"
#include "client/map_file.h"
#include "client/match_outputs.h"
#include "client/progress_display.h"
#include "core/base/status_macros.h"
#include "server/server.h"
#include "server/server_config.h"

namespace isomatch {
namespace {

constexpr char kFooter[] = R"(
MAP has one line for each vertex of X, in the order of X's file: the 0-based
vertex of Y that it corresponds to, or -1 for a vertex on no face. Its extension
tells the format: .npy is the same as a NumPy array of int64, .json as JSON,
.ply is X in the colours of Y, to be looked at; anything else is text.

Without --server the work is done in this process, by the same server code.

Examples:
  isomatch match X.off Y.ply -o map.txt
  isomatch match X.off Y.ply -o map.txt --report report.json
  isomatch match X.off Y.ply --landmarks pairs.txt --no-progress > map.txt
  isomatch match X.off Y.ply -o map.npy
  isomatch match X.off Y.ply -o colored.ply --confidence confidence.txt
  isomatch match X.off Y.ply -o map.txt --server 127.0.0.1:7443
  isomatch match X.off Y.ply -o map.txt --precise points.txt
  isomatch match X.off Y.ply -o map.txt --server meshes.example.org:7443 \
                 --tls-ca ca.crt --api-key-file alice.key

A landmark file has lines `x y` of 0-based vertices known to match; # starts a
comment. One that the rest of the map contradicts is changed, and a warning says
so; --landmarks-exact keeps all as they are.

Further files, one line for each vertex of X:
  --precise      FACE W0 W1 W2: a 0-based face of Y and the weights of its three
                 vertices in the file's order, sum 1; -1 0 0 0 for no place
  --confidence   0 (do not trust its line of MAP) to 1
  --alternative  as MAP: the best of the maps that were not chosen; no file, but
                 a warning, when no other came near
--functional-map has the eigenvalues of both meshes and, by rows, the matrix
that carries eigenfunctions of Y (columns) to X (rows).)";

// Below it a second map is nearly as good as the chosen one.
constexpr double kLowSymmetryConfidence = 0.2;

struct Arguments {
  std::string x;
  std::string y;
  ConnectionFlags connection;
  std::string landmarks;
  std::string profile = "default";
  std::uint64_t random_seed = 1;
  std::uint32_t threads = 0;
  std::optional<std::uint32_t> solved_vertices;
  std::int32_t priority = 0;
  bool landmarks_exact = false;
  MatchOutputs outputs;
  bool no_progress = false;
};

absl::StatusOr<MatchRequest> MakeRequest(const Arguments& arguments,
                                         MeshFacts* facts) {
  MatchRequest request;
  ISOMATCH_ASSIGN_OR_RETURN(request.mesh_x,
                            LoadMesh(arguments.x, "X", &facts->warnings));
  ISOMATCH_ASSIGN_OR_RETURN(request.mesh_y,
                            LoadMesh(arguments.y, "Y", &facts->warnings));
  if (NeedColors(arguments.outputs)) {
    ISOMATCH_ASSIGN_OR_RETURN(
        facts->colors_y,
        ReadVertexColors(arguments.y, request.mesh_y.num_vertices()));
  }
  if (!arguments.landmarks.empty()) {
    ISOMATCH_ASSIGN_OR_RETURN(
        request.landmarks,
        ReadLandmarks(arguments.landmarks, request.mesh_x.num_vertices(),
                      request.mesh_y.num_vertices()));
  }
  request.profile =
      arguments.profile == "paper" ? v1::PROFILE_PAPER : v1::PROFILE_DEFAULT;
  request.random_seed = arguments.random_seed;
  request.threads = arguments.threads;
  request.solved_vertices = arguments.solved_vertices;
  request.priority = arguments.priority;
  request.landmarks_exact = arguments.landmarks_exact;
  request.parts = PartsFor(arguments.outputs);
  return request;
}

absl::StatusOr<std::unique_ptr<Server>> StartEmbedded(
    const Arguments& arguments) {
  ServerConfig config;
  config.listen.clear();
  config.threads_per_job = static_cast<int>(arguments.threads);
  return Server::Create(config);
}

absl::StatusOr<MatchResult> RunMatch(
    const std::shared_ptr<grpc::Channel>& channel, const MatchRequest& request,
    const Arguments& arguments, const Terminal& terminal) {
  const ProgressStyle style = arguments.no_progress     ? ProgressStyle::kNone
                              : terminal.is_interactive ? ProgressStyle::kBar
                                                        : ProgressStyle::kLines;
  ProgressDisplay display(terminal.err, style);
  return IsomatchClient(channel).Match(
      request, [&](const v1::Job& job) { display.Show(job); }, terminal.stop);
}

absl::StatusOr<MatchResult> RunRemote(const MatchRequest& request,
                                      const ConnectionSecurity& security,
                                      const Arguments& arguments,
                                      const Terminal& terminal) {
  const std::string& server = arguments.connection.server;
  absl::StatusOr<MatchResult> result =
      RunMatch(ConnectTo(server, security), request, arguments, terminal);
  if (result.ok()) return result;
  const absl::Status& status = result.status();
  switch (status.code()) {
    case absl::StatusCode::kUnavailable:
      return absl::UnavailableError(
          absl::StrCat("--server ", server, ": ", status.message()));
    case absl::StatusCode::kUnauthenticated:
      return absl::UnauthenticatedError(
          absl::StrCat("--server ", server, ": ", status.message(),
                       ", expected --api-key-file or ISOMATCH_API_KEY"));
    default:
      return result;
  }
}

absl::StatusOr<MatchResult> RunEmbedded(const MatchRequest& request,
                                        const Arguments& arguments,
                                        const Terminal& terminal) {
  ISOMATCH_ASSIGN_OR_RETURN(const std::unique_ptr<Server> server,
                            StartEmbedded(arguments));
  return RunMatch(server->InProcessChannel(), request, arguments, terminal);
}

// What the user should know about a result.
std::vector<std::string> WarningsOf(const v1::ResultInfo& info) {
  std::vector<std::string> warnings(info.warnings().begin(),
                                    info.warnings().end());
  if (info.alternatives_size() > 0 &&
      info.symmetry_confidence() < kLowSymmetryConfidence) {
    warnings.push_back(absl::StrFormat(
        "the map may be a symmetric image: another one is nearly as good "
        "(symmetry confidence %.2f of 1), see --alternative",
        info.symmetry_confidence()));
  }
  return warnings;
}

absl::Status Run(const Arguments& arguments, const Terminal& terminal) {
  ISOMATCH_RETURN_IF_ERROR(CheckOutputs(arguments.outputs));
  MeshFacts facts;
  ConnectionSecurity security;
  const bool is_embedded = arguments.connection.server.empty();
  if (!is_embedded) {
    ISOMATCH_ASSIGN_OR_RETURN(
        security,
        LoadSecurity(arguments.connection, std::getenv("ISOMATCH_API_KEY")));
    Warn(SecurityWarnings(arguments.connection, security), terminal);
  }
  ISOMATCH_ASSIGN_OR_RETURN(const MatchRequest request,
                            MakeRequest(arguments, &facts));
  Warn(facts.warnings, terminal);
  ISOMATCH_ASSIGN_OR_RETURN(
      const MatchResult result,
      is_embedded ? RunEmbedded(request, arguments, terminal)
                  : RunRemote(request, security, arguments, terminal));
  Warn(WarningsOf(result.info), terminal);
  return WriteOutputs(arguments.outputs, request, result, facts, terminal);
}

void AddInputs(CLI::App* command, Arguments* arguments) {
  command->add_option("X", arguments->x, "Mesh: .off, .obj, .ply or .stl")
      ->required();
  command->add_option("Y", arguments->y, "Mesh: .off, .obj, .ply or .stl")
      ->required();
  command->add_option("--landmarks", arguments->landmarks,
                      "File of known matches, lines `x y`");
  command->add_flag("--landmarks-exact", arguments->landmarks_exact,
                    "Keep every landmark, even one that the rest contradicts");
}

void AddOutputs(CLI::App* command, MatchOutputs* outputs) {
  command
      ->add_option("-o,--output", outputs->map,
                   "MAP to write: .txt, .npy, .json or .ply; - is "
                   "standard output")
      ->capture_default_str();
  command->add_option("--precise", outputs->precise,
                      "File of places between the vertices of Y");
  command->add_option("--confidence", outputs->confidence,
                      "File of how far to trust each line of MAP, 0 to 1");
  command->add_option("--alternative", outputs->alternative,
                      "MAP of the runner-up, as a rule a symmetric image");
  command->add_option("--functional-map", outputs->functional_map,
                      "JSON file of the map between eigenfunctions");
  command->add_option("--report", outputs->report,
                      "JSON file about the run: times, memory, quality");
}

// How and where the work is done.
void AddRun(CLI::App* command, Arguments* arguments) {
  AddConnectionFlags(command, &arguments->connection);
  command
      ->add_option("--priority", arguments->priority,
                   "With --server: jobs of a higher one start first")
      ->check(CLI::Range(-100, 100))
      ->capture_default_str();
  command
      ->add_option("--profile", arguments->profile,
                   "default: what measured best; paper: as published")
      ->check(CLI::IsMember({"default", "paper"}))
      ->capture_default_str();
  command
      ->add_option("--random-seed", arguments->random_seed,
                   "The same seed gives the same map")
      ->capture_default_str();
  command->add_option("--solved-vertices", arguments->solved_vertices,
                      "Decimate larger meshes to about as many and lift the "
                      "map; 0 never does, not given: as the profile has it");
  command
      ->add_option("--threads", arguments->threads,
                   "0: all cores, or the server's share")
      ->check(CLI::Range(0, 1024))
      ->capture_default_str();
}

}  // namespace

Command AddMatchCommand(CLI::App& app) {
  CLI::App* command = app.add_subcommand(
      "match", "Finds for every vertex of mesh X its place on mesh Y.");
  const auto arguments = std::make_shared<Arguments>();
  AddInputs(command, arguments.get());
  AddOutputs(command, &arguments->outputs);
  AddRun(command, arguments.get());
  command->add_flag("--no-progress", arguments->no_progress,
                    "Say nothing on standard error but warnings and errors");
  command->footer(kFooter);
  return {command, [arguments](const Terminal& terminal) {
            return Run(*arguments, terminal);
          }};
}

}  // namespace isomatch
