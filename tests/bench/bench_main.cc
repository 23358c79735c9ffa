#include <cstdio>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>

#include "tests/bench/accuracy.h"
#include "tests/bench/option_overrides.h"

namespace isomatch::bench {
namespace {

struct Arguments {
  PairSelection pairs;
  std::string profile = "default";
  std::string out;
  std::vector<std::string> settings;
};

CLI::App* AddPairCommand(CLI::App* app, const char* name, const char* help,
                         Arguments* arguments) {
  CLI::App* command = app->add_subcommand(name, help);
  command
      ->add_option("DATA_DIR", arguments->pairs.dir,
                   "Folder with pairs.txt, NAME.off and gt_X__Y.txt")
      ->required();
  command->add_option("--profile", arguments->profile, "default or paper")
      ->check(CLI::IsMember({"default", "paper"}))
      ->capture_default_str();
  command->add_option("--filter", arguments->pairs.filter,
                      "Only pairs whose names contain this");
  command
      ->add_option("--true-landmarks", arguments->pairs.true_landmarks,
                   "Matches of the truth to give to each pair")
      ->check(CLI::Range(0, 1000))
      ->capture_default_str();
  command->add_option("--set", arguments->settings,
                      "Another value of an option: name=number, repeatable");
  return command;
}

absl::Status Run(const Arguments& arguments, bool ablation) {
  MatchOptions options = MatchOptions::ForProfile(
      arguments.profile == "paper" ? Profile::kPaper : Profile::kDefault);
  if (const absl::Status status = ApplyOverrides(arguments.settings, &options);
      !status.ok()) {
    return status;
  }
  if (ablation) return RunAblation(arguments.pairs, options);
  return RunAccuracy(arguments.pairs, options, arguments.out);
}

int Main(int argc, char** argv) {
  CLI::App app("Figures about accuracy, on sets of mesh pairs with a truth",
               "isomatch-bench");
  app.require_subcommand(1);
  Arguments arguments;
  CLI::App* const accuracy =
      AddPairCommand(&app, "accuracy",
                     "Errors of every pair, by stage and in total", &arguments);
  accuracy->add_option("--out", arguments.out, "The figures as JSON");
  const CLI::App* const ablation = AddPairCommand(
      &app, "ablation", "The swapping ablation of the paper's Table 1",
      &arguments);
  CLI11_PARSE(app, argc, argv);
  const absl::Status status = Run(arguments, ablation->parsed());
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
