#include <cstdio>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>

#include "core/pipeline/instruction_set.h"
#include "tests/bench/accuracy.h"
#include "tests/bench/option_overrides.h"
#include "tests/bench/pair_set.h"
#include "tests/bench/queue_bench.h"
#include "tests/bench/service_bench.h"
#include "tests/bench/speed.h"

namespace isomatch::bench {
namespace {

struct Arguments {
  PairSelection pairs;
  SpeedSelection speed = {.sizes = {1000, 5000, 13000, 50000, 100000, 200000}};
  ServiceSelection service;
  QueueSelection queue;
  int threads = 0;
  std::string profile = "default";
  std::string relation = RelationName(Relation::kWhole);
  std::string scale = LengthScaleName(LengthScale::kAuto);
  std::string out;
  std::vector<std::string> settings;
  std::vector<double> deadlines = {0.05, 0.15, 0.2, 0.25, 0.3,
                                   0.35, 0.4,  0.5, 1};
  std::string instruction_set = InstructionSet();
};

void AddMatchOptions(CLI::App* command, Arguments* arguments) {
  command->add_option("--profile", arguments->profile, "default or paper")
      ->check(CLI::IsMember({"default", "paper"}))
      ->capture_default_str();
  command
      ->add_option("--relation", arguments->relation,
                   "What of each shape has a counterpart: all of both, or X "
                   "is a part of Y, Y of X, or both overlap")
      ->check(CLI::IsMember(RelationNames()))
      ->capture_default_str();
  command
      ->add_option("--scale", arguments->scale,
                   "Of parts: same where both have one unit, else auto")
      ->check(CLI::IsMember(LengthScaleNames()))
      ->capture_default_str();
  command->add_option("--set", arguments->settings,
                      "Another value of an option: name=number, repeatable");
  command
      ->add_option("--instruction-set", arguments->instruction_set,
                   "What the method runs on, kernels apart")
      ->check(CLI::IsMember(InstructionSets()))
      ->capture_default_str();
  command->add_option("--threads", arguments->threads, "0: one for each core")
      ->check(CLI::Range(0, 1024))
      ->capture_default_str();
}

CLI::App* AddPairCommand(CLI::App* app, const char* name, const char* help,
                         Arguments* arguments) {
  CLI::App* command = app->add_subcommand(name, help);
  command
      ->add_option("DATA_DIR", arguments->pairs.dir,
                   "Folder with pairs.txt, NAME.off or NAME.drc, and "
                   "gt_X__Y.txt")
      ->required();
  command->add_option("--pairs", arguments->pairs.list,
                      "A list in place of DATA_DIR/pairs.txt");
  command->add_option("--filter", arguments->pairs.filter,
                      "Only pairs whose names contain this");
  command
      ->add_option("--true-landmarks", arguments->pairs.true_landmarks,
                   "Matches of the truth to give to each pair")
      ->check(CLI::Range(0, 1000))
      ->capture_default_str();
  command->add_flag("--as-sent", arguments->pairs.as_sent,
                    "Meshes go through Draco first, as clients send them: the "
                    "maps are those of isomatch match and batch");
  AddMatchOptions(command, arguments);
  return command;
}

CLI::App* AddSpeedCommand(CLI::App* app, Arguments* arguments) {
  CLI::App* command = app->add_subcommand(
      "speed", "Time and memory by stage, over sizes of the sample animal");
  command
      ->add_option("--sizes", arguments->speed.sizes,
                   "Vertices a side, separated by commas")
      ->delimiter(',')
      ->check(CLI::Range(100, 5'000'000))
      ->capture_default_str();
  command->add_option("--dir", arguments->speed.dir,
                      "Instead: the pairs of a folder as for accuracy");
  command->add_option("--filter", arguments->speed.filter,
                      "Only pairs of it whose names contain this");
  command->add_option("--against", arguments->speed.against,
                      "Compare with what an earlier run wrote by --out");
  AddMatchOptions(command, arguments);
  command->add_option("--runs", arguments->speed.runs, "The median counts")
      ->check(CLI::Range(1, 100))
      ->capture_default_str();
  return command;
}

CLI::App* AddServiceCommand(CLI::App* app, Arguments* arguments) {
  CLI::App* command = app->add_subcommand(
      "service", "What jobs cost through the service, and its cache saves");
  ServiceSelection& service = arguments->service;
  command
      ->add_option("--sizes", service.sizes,
                   "Vertices a side of the sample animal, separated by commas")
      ->delimiter(',')
      ->check(CLI::Range(100, 1'000'000))
      ->capture_default_str();
  const auto add_count = [&](const char* name, int& count, int least,
                             const char* help) {
    command->add_option(name, count, help)
        ->check(CLI::Range(least, 1000))
        ->capture_default_str();
  };
  add_count("--jobs", service.jobs, 1, "Pairs of runs; the median counts");
  add_count("--workers", service.workers, 1, "Jobs at the same time");
  add_count("--targets", service.targets, 0,
            "Meshes that one template is matched with");
  command
      ->add_option("--threads", arguments->threads,
                   "Of a job; 0: the cores are shared among the workers")
      ->check(CLI::Range(0, 1024))
      ->capture_default_str();
  return command;
}

CLI::App* AddQueueCommand(CLI::App* app, Arguments* arguments) {
  CLI::App* command = app->add_subcommand(
      "queue", "What a queue on PostgreSQL can do, on a server of its own");
  QueueSelection& queue = arguments->queue;
  command
      ->add_option("--workers", queue.workers,
                   "Workers that claim at the same time, separated by commas")
      ->delimiter(',')
      ->check(CLI::Range(1, 64))
      ->capture_default_str();
  command
      ->add_option("--job-seconds", queue.job_seconds,
                   "How long a worker holds a job instead of computing")
      ->check(CLI::Range(0.0, 60.0))
      ->capture_default_str();
  const auto add_count = [&](const char* name, int& count, const char* help) {
    command->add_option(name, count, help)
        ->check(CLI::Range(1, 100'000'000))
        ->capture_default_str();
  };
  add_count("--jobs", queue.jobs, "Jobs for each number of workers");
  add_count("--queued", queue.queued,
            "Jobs that wait while CreateJob is timed");
  add_count("--passing", queue.passing,
            "Jobs that pass while the size of the table is watched");
  command->add_flag("--namespaces", queue.namespaces,
                    "Each worker is in a network namespace of its own, as on a "
                    "machine of its own; needs root");
  command->add_flag("!--no-fsync", queue.fsync,
                    "The database does not wait for its disk");
  return command;
}

void AddPackCommand(CLI::App* app, Arguments* arguments) {
  CLI::App* command = app->add_subcommand(
      "pack",
      "Writes the shapes of a folder of pairs as Draco, as tests/data "
      "has them");
  command->add_option("DATA_DIR", arguments->pairs.dir, "As for accuracy")
      ->required();
  command->add_option("OUT", arguments->out, "Folder that gets the NAME.drc")
      ->required();
}

absl::Status Run(const Arguments& arguments, const std::string& command) {
  if (command == "pack") return PackShapes(arguments.pairs.dir, arguments.out);
  if (command == "queue") return RunQueue(arguments.queue, arguments.out);
  MatchOptions options = MatchOptions::ForProfile(
      arguments.profile == "paper" ? Profile::kPaper : Profile::kDefault);
  if (const absl::Status status = ApplyOverrides(arguments.settings, &options);
      !status.ok()) {
    return status;
  }
  options.threads = arguments.threads;
  options.relation = RelationOf(arguments.relation).value();
  options.scale = LengthScaleOf(arguments.scale).value();
  if (const absl::Status status = UseInstructionSet(arguments.instruction_set);
      !status.ok()) {
    return status;
  }
  if (command == "deadline") {
    return RunDeadlines(arguments.pairs, arguments.deadlines, options);
  }
  if (command == "ablation") return RunAblation(arguments.pairs, options);
  if (command == "service") {
    return RunService(arguments.service, options, arguments.out);
  }
  if (command == "speed") {
    return RunSpeed(arguments.speed, options, arguments.out);
  }
  return RunAccuracy(arguments.pairs, options, arguments.out);
}

int Main(int argc, char** argv) {
  CLI::App app("Figures about accuracy and speed", "isomatch-bench");
  app.require_subcommand(1);
  Arguments arguments;
  CLI::App* const accuracy =
      AddPairCommand(&app, "accuracy",
                     "Errors of every pair, by stage and in total", &arguments);
  CLI::App* const speed = AddSpeedCommand(&app, &arguments);
  CLI::App* const service = AddServiceCommand(&app, &arguments);
  CLI::App* const queue = AddQueueCommand(&app, &arguments);
  for (CLI::App* const command : {accuracy, speed, service, queue}) {
    command->add_option("--out", arguments.out, "The figures as JSON");
  }
  AddPairCommand(&app, "ablation",
                 "The swapping ablation of the paper's Table 1", &arguments);
  AddPairCommand(&app, "deadline", "Errors of the maps there are in time",
                 &arguments)
      ->add_option("--seconds", arguments.deadlines,
                   "Deadlines, separated by commas; 0 for none")
      ->delimiter(',')
      ->check(CLI::Range(0.0, 3600.0))
      ->capture_default_str();
  AddPackCommand(&app, &arguments);
  CLI11_PARSE(app, argc, argv);
  const absl::Status status =
      Run(arguments, app.get_subcommands().front()->get_name());
  if (status.ok()) return 0;
  std::fprintf(stderr, "isomatch-bench: %s\n",
               std::string(status.message()).c_str());
  return status.code() == absl::StatusCode::kInvalidArgument ||
                 status.code() == absl::StatusCode::kNotFound
             ? 2
             : 1;
}

}  // namespace
}  // namespace isomatch::bench

int main(int argc, char** argv) { return isomatch::bench::Main(argc, argv); }
