#include <algorithm>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <system_error>
#include <thread>
#include <utility>
#include <vector>

#include <CLI/CLI.hpp>

#include "absl/status/statusor.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "client/batch/batch_list.h"
#include "client/batch/batch_runner.h"
#include "client/batch/batch_table.h"
#include "client/cli/commands.h"
#include "client/cli/connection_flags.h"
#include "client/cli/embedded_server.h"
#include "client/cli/job_flags.h"
#include "client/cli/option_support.h"
#include "client/cli/progress_line.h"
#include "client/cli/remote_server.h"
#include "client/files/text_file.h"
#include "core/base/status_macros.h"
#include "core/pipeline/match_options.h"

namespace isomatch {
namespace {

constexpr char kBatchFooter[] = R"(
LIST has lines `X Y [LANDMARKS]` or `X Y X_POINTS Y_POINTS`, files as `match`
takes them, paths relative to LIST's folder, where the extension of a mesh may be
left out; # starts a comment. Paths with blanks stand
between double quotes, or all of a line between tabs. With --template each MESH, or
each mesh of a folder, is the Y of one template.

For each pair FOLDER gets X__Y.txt, the map, and X__Y.json, its report; summary.csv
has a line for each. --precise and --confidence add X__Y.precise.txt and
X__Y.confidence.txt, another --relation than whole X__Y.mask_y.txt, as `match`
writes them. Run the same command again and pairs that are done are kept: after a
kill, a crash or Ctrl-C only the rest is matched. Other meshes, options or another
version of isomatch make a pair new.

--truth FOLDER measures maps against FOLDER/gt_X__Y.txt, files as `evaluate` takes
them: the columns direct and best are mean geodesic errors over the diameter of Y.

Exit status: 0 when every pair has its map, 1 when one failed (the others have
theirs).

Examples:
  isomatch batch pairs.txt -o maps
  isomatch batch --template template.off scans -o maps
  isomatch batch --template template.off a.ply b.ply -o maps --reverse
  isomatch batch pairs.txt -o maps --server meshes.example.org:7443 --parallel 8
  isomatch batch data/pairs.txt -o maps --truth data)";

struct BatchArguments {
  std::vector<std::string> inputs;
  std::string template_mesh;
  std::string truth;
  ConnectionFlags connection;
  BatchOptions options;
  int parallel = 0;
  bool reverse = false;
  bool json = false;
  bool no_progress = false;
};

absl::StatusOr<std::vector<BatchPair>> ReadPairs(
    const BatchArguments& arguments) {
  std::vector<BatchPair> pairs;
  if (!arguments.template_mesh.empty()) {
    ISOMATCH_ASSIGN_OR_RETURN(
        pairs, PairWithTemplate(arguments.template_mesh, arguments.inputs,
                                arguments.reverse));
  } else if (arguments.inputs.size() == 1) {
    ISOMATCH_ASSIGN_OR_RETURN(pairs, ReadBatchList(arguments.inputs[0]));
  } else {
    return absl::InvalidArgumentError(
        absl::StrCat("expected one LIST, or --template with meshes; found ",
                     arguments.inputs.size(), " files"));
  }
  if (!arguments.truth.empty()) {
    ISOMATCH_RETURN_IF_ERROR(AddTruths(arguments.truth, &pairs));
  }
  return pairs;
}

absl::Status MakeFolder(const std::string& folder) {
  std::error_code error;
  std::filesystem::create_directories(folder, error);
  if (std::filesystem::is_directory(folder)) return absl::OkStatus();
  return absl::InvalidArgumentError(
      absl::StrCat("--output '", folder,
                   "': cannot be made, expected a folder: ", error.message()));
}

ProgressNews NewsOf(const BatchProgress& progress) {
  ProgressNews news;
  news.fraction = progress.fraction;
  news.label =
      absl::StrFormat("%d of %d pairs", progress.ended, progress.total);
  news.detail = absl::StrCat(", ", progress.running, " running");
  if (progress.failed > 0) {
    absl::StrAppend(&news.detail, ", ", progress.failed, " failed");
  }
  return news;
}

int Cores() {
  return std::max(1, static_cast<int>(std::thread::hardware_concurrency()));
}

absl::Status Finish(const BatchArguments& arguments, const BatchRunner& runner,
                    const std::vector<BatchRow>& rows,
                    const Terminal& terminal) {
  ISOMATCH_RETURN_IF_ERROR(
      Print(arguments.json ? FormatBatchJson(rows) : FormatBatchTable(rows),
            terminal));
  ISOMATCH_RETURN_IF_ERROR(runner.summary_status());
  if (terminal.stop.stop_requested()) {
    return absl::CancelledError(
        "interrupted; the same command goes on where it was");
  }
  const auto has_failed = [](const BatchRow& row) {
    return row.state == BatchState::kFailed ||
           row.state == BatchState::kWaiting;
  };
  const auto failed = std::count_if(rows.begin(), rows.end(), has_failed);
  if (failed == 0) return absl::OkStatus();
  const auto first = std::find_if(rows.begin(), rows.end(), has_failed);
  return absl::InternalError(
      absl::StrCat(failed, " of ", rows.size(), " pairs have no map; ",
                   first->x, " to ", first->y, ": ", first->message));
}

absl::Status RunBatch(const BatchArguments& arguments,
                      const Terminal& terminal) {
  ISOMATCH_ASSIGN_OR_RETURN(const std::vector<BatchPair> pairs,
                            ReadPairs(arguments));
  ISOMATCH_RETURN_IF_ERROR(MakeFolder(arguments.options.folder));
  ISOMATCH_RETURN_IF_ERROR(
      CheckOutputFile(absl::StrCat(arguments.options.folder, "/summary.csv")));
  BatchOptions options = arguments.options;
  options.parallel = arguments.parallel;
  options.parts.mask_y = RelationOf(options.job.relation) != Relation::kWhole;
  std::unique_ptr<Server> embedded;
  std::optional<IsomatchClient> client;
  if (arguments.connection.server.empty()) {
    if (options.parallel == 0) options.parallel = Cores();
    options.job.threads = ThreadsHere(options.job.threads);
    ISOMATCH_ASSIGN_OR_RETURN(
        embedded, StartEmbeddedServer(options.parallel, options.job.threads));
    client = ClientOf(embedded.get());
  } else {
    ISOMATCH_ASSIGN_OR_RETURN(
        const RemoteServer server,
        RemoteServer::Open(arguments.connection, terminal));
    client = server.client();
    const auto info = client->GetServerInfo(terminal.stop);
    if (!info.ok()) return server.Explain(info.status());
    // One more than run, so that the next pair is there when one ends.
    if (options.parallel == 0) {
      options.parallel = static_cast<int>(info->workers()) + 1;
    }
  }
  ProgressLine line(terminal.err, ProgressStyleFor(terminal.is_interactive,
                                                   arguments.no_progress));
  BatchRunner runner(&*client, options, [&](const BatchProgress& progress) {
    line.Show(NewsOf(progress));
  });
  const std::vector<BatchRow> rows = runner.Run(pairs, terminal.stop);
  return Finish(arguments, runner, rows, terminal);
}

void AddOptions(CLI::App* command, BatchArguments* arguments) {
  command
      ->add_option("LIST", arguments->inputs,
                   "List of pairs; with --template meshes or folders of meshes")
      ->type_name(kFile)
      ->required();
  command
      ->add_option("-o,--output", arguments->options.folder,
                   "Folder to write to, made when missing")
      ->type_name(kFolder)
      ->required();
  command->add_flag(
      "--precise", arguments->options.parts.precise,
      "Write places between the vertices of Y for each pair, too");
  command->add_flag("--confidence", arguments->options.parts.confidence,
                    "Write how far to trust each line for each pair, too");
  SetGroup(command, kFilesGroup, {"--output", "--precise", "--confidence"});
  CLI::Option* const template_mesh =
      command
          ->add_option("--template", arguments->template_mesh,
                       "Mesh X that is matched to each MESH")
          ->type_name(kFile);
  command
      ->add_flag("--reverse", arguments->reverse,
                 "Match each MESH to the template instead")
      ->needs(template_mesh);
  command
      ->add_option("--truth", arguments->truth,
                   "Folder of ground truths gt_X__Y.txt")
      ->type_name(kFolder);
  command
      ->add_option("--parallel", arguments->parallel,
                   "Pairs at the same time; 0: one for each core, or one more "
                   "than the server has workers")
      ->check(WholeNumber(0, 256))
      ->type_name("COUNT")
      ->capture_default_str();
  command->add_flag("--force", arguments->options.force,
                    "Match pairs that are done already too");
  command->add_flag("--json", arguments->json,
                    "Print JSON, an object in a line for each pair");
  command->add_flag("--no-progress", arguments->no_progress,
                    "Say nothing on standard error but warnings and errors");
}

}  // namespace

Command AddBatchCommand(CLI::App& app) {
  CLI::App* command = app.add_subcommand(
      "batch", "Matches many pairs; goes on where it was stopped.");
  const auto arguments = std::make_shared<BatchArguments>();
  AddOptions(command, arguments.get());
  AddConnectionFlags(command, &arguments->connection, ServerUse::kOptional);
  AddJobFlags(command, &arguments->options.job);
  command->footer(kBatchFooter);
  return {command, [arguments](const Terminal& terminal) {
            return RunBatch(*arguments, terminal);
          }};
}

}  // namespace isomatch
