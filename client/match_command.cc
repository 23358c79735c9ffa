#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "absl/status/statusor.h"
#include "absl/strings/match.h"
#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "client/commands.h"
#include "client/isomatch_client.h"
#include "client/match_report.h"
#include "client/mesh_file.h"
#include "client/progress_display.h"
#include "client/text_file.h"
#include "core/base/status_macros.h"
#include "server/server.h"
#include "server/server_config.h"

namespace isomatch {
namespace {

constexpr char kFooter[] = R"(
MAP has one line for each vertex of X, in the order of X's file: the 0-based
vertex of Y that it corresponds to, or -1 for a vertex on no face.

Without --server the work is done in this process, by the same server code.

Examples:
  isomatch match X.off Y.ply -o map.txt
  isomatch match X.off Y.ply -o map.txt --report report.json
  isomatch match X.off Y.ply --landmarks pairs.txt --no-progress > map.txt
  isomatch match X.off Y.ply -o map.txt --server 127.0.0.1:7443

A landmark file has lines `x y` of 0-based vertices known to match; # starts a
comment.)";

struct Arguments {
  std::string x;
  std::string y;
  std::string output = "-";
  std::string server;
  std::string landmarks;
  std::string profile = "default";
  std::uint64_t random_seed = 1;
  std::uint32_t threads = 0;
  std::string report;
  bool no_progress = false;
};

// What CLI11 tells the user about a --server that is none; empty when it is.
std::string CheckAddress(const std::string& address) {
  if (absl::StartsWith(address, "unix:")) return "";
  const std::size_t colon = address.rfind(':');
  int port = 0;
  if (colon != std::string::npos && colon > 0 &&
      absl::SimpleAtoi(address.substr(colon + 1), &port) && port > 0 &&
      port <= 65535) {
    return "";
  }
  return absl::StrCat("'", address, "', expected HOST:PORT");
}

absl::Status CheckOutputs(const Arguments& arguments) {
  if (arguments.output != "-") {
    ISOMATCH_RETURN_IF_ERROR(CheckOutputFile(arguments.output));
  }
  if (!arguments.report.empty() && arguments.report == arguments.output) {
    return absl::InvalidArgumentError(absl::StrCat(
        "--report '", arguments.report, "': is the MAP too, expected another"));
  }
  return arguments.report.empty() ? absl::OkStatus()
                                  : CheckOutputFile(arguments.report);
}

// Reads a mesh and appends what is to be said about it to `warnings`.
absl::StatusOr<TriangleMesh> Load(const std::string& path,
                                  const std::string& field,
                                  std::vector<std::string>* warnings) {
  ISOMATCH_ASSIGN_OR_RETURN(LoadedMesh loaded, ReadMesh(path, field));
  for (const std::string& warning : loaded.warnings) {
    warnings->push_back(absl::StrCat(field, ": '", path, "': ", warning));
  }
  return std::move(loaded.mesh);
}

absl::StatusOr<MatchRequest> MakeRequest(const Arguments& arguments,
                                         std::vector<std::string>* warnings) {
  MatchRequest request;
  ISOMATCH_ASSIGN_OR_RETURN(request.mesh_x, Load(arguments.x, "X", warnings));
  ISOMATCH_ASSIGN_OR_RETURN(request.mesh_y, Load(arguments.y, "Y", warnings));
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
                                      const Arguments& arguments,
                                      const Terminal& terminal) {
  absl::StatusOr<MatchResult> result =
      RunMatch(ConnectTo(arguments.server), request, arguments, terminal);
  if (result.ok() || result.status().code() != absl::StatusCode::kUnavailable) {
    return result;
  }
  return absl::UnavailableError(absl::StrCat("--server ", arguments.server,
                                             ": ", result.status().message()));
}

absl::StatusOr<MatchResult> RunEmbedded(const MatchRequest& request,
                                        const Arguments& arguments,
                                        const Terminal& terminal) {
  ISOMATCH_ASSIGN_OR_RETURN(const std::unique_ptr<Server> server,
                            StartEmbedded(arguments));
  return RunMatch(server->InProcessChannel(), request, arguments, terminal);
}

void Warn(const std::vector<std::string>& warnings, const Terminal& terminal) {
  for (const std::string& warning : warnings) {
    terminal.err << "isomatch: warning: " << warning << std::endl;
  }
}

absl::Status WriteMap(const std::string& path, const VertexMap& y_from_x,
                      const Terminal& terminal) {
  const std::string text = FormatMap(y_from_x);
  if (path != "-") return WriteFileAtomically(path, text);
  terminal.out << text << std::flush;
  return terminal.out ? absl::OkStatus()
                      : absl::UnavailableError(
                            "the map cannot be written to standard output");
}

absl::Status Run(const Arguments& arguments, const Terminal& terminal) {
  ISOMATCH_RETURN_IF_ERROR(CheckOutputs(arguments));
  std::vector<std::string> warnings;
  ISOMATCH_ASSIGN_OR_RETURN(const MatchRequest request,
                            MakeRequest(arguments, &warnings));
  Warn(warnings, terminal);
  ISOMATCH_ASSIGN_OR_RETURN(const MatchResult result,
                            arguments.server.empty()
                                ? RunEmbedded(request, arguments, terminal)
                                : RunRemote(request, arguments, terminal));
  Warn({result.info.warnings().begin(), result.info.warnings().end()},
       terminal);
  if (!arguments.report.empty()) {
    ISOMATCH_RETURN_IF_ERROR(WriteFileAtomically(
        arguments.report, FormatReport(request, result, warnings)));
  }
  return WriteMap(arguments.output, result.y_from_x, terminal);
}

}  // namespace

Command AddMatchCommand(CLI::App& app) {
  CLI::App* command = app.add_subcommand(
      "match", "Finds for every vertex of mesh X its place on mesh Y.");
  const auto arguments = std::make_shared<Arguments>();
  command->add_option("X", arguments->x, "Mesh: .off, .obj, .ply or .stl")
      ->required();
  command->add_option("Y", arguments->y, "Mesh: .off, .obj, .ply or .stl")
      ->required();
  command
      ->add_option("-o,--output", arguments->output,
                   "MAP to write; - is standard output")
      ->capture_default_str();
  command
      ->add_option("--server", arguments->server,
                   "HOST:PORT of a running isomatch-server")
      ->check(CLI::Validator(CheckAddress, "HOST:PORT"));
  command->add_option("--landmarks", arguments->landmarks,
                      "File of known matches, lines `x y`");
  command
      ->add_option("--profile", arguments->profile,
                   "default: what measured best; paper: as published")
      ->check(CLI::IsMember({"default", "paper"}))
      ->capture_default_str();
  command
      ->add_option("--random-seed", arguments->random_seed,
                   "The same seed gives the same map")
      ->capture_default_str();
  command
      ->add_option("--threads", arguments->threads,
                   "0: all cores, or the server's share")
      ->check(CLI::Range(0, 1024))
      ->capture_default_str();
  command->add_option("--report", arguments->report,
                      "JSON file about the run: times, memory, quality");
  command->add_flag("--no-progress", arguments->no_progress,
                    "Say nothing on standard error but warnings and errors");
  command->footer(kFooter);
  return {command, [arguments](const Terminal& terminal) {
            return Run(*arguments, terminal);
          }};
}

}  // namespace isomatch
