#include <memory>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>
#include <nlohmann/json.hpp>

#include "absl/status/statusor.h"
#include "absl/strings/str_cat.h"
#include "absl/time/clock.h"
#include "client/api/isomatch_client.h"
#include "client/cli/commands.h"
#include "client/cli/connection_flags.h"
#include "client/cli/job_flags.h"
#include "client/cli/job_text.h"
#include "client/cli/match_outputs.h"
#include "client/cli/option_support.h"
#include "client/cli/progress_display.h"
#include "client/cli/remote_server.h"
#include "core/base/status_macros.h"

namespace isomatch {
namespace {

constexpr char kWatchFooter[] = R"(
Shows the job's progress until it ends. Exit status: 0 when it succeeded, 1 when it
failed or was cancelled, 2 when its input was wrong. Ctrl-C ends the watching, not
the job. A lost connection is made again, and nothing is missed.

Examples:
  isomatch watch jobs/4f1a...
  isomatch watch 4f1a... --json | jq .progress.total_fraction)";

constexpr char kListFooter[] = R"(
Newest first. --label and --state narrow the list; several labels must all fit, of
several states one.

Examples:
  isomatch list
  isomatch list --state running --state queued
  isomatch list --label study=spring --limit 1000 --json)";

constexpr char kCancelFooter[] = R"(
A job that has ended already is an error; the others are cancelled all the same.

Examples:
  isomatch cancel jobs/4f1a...
  isomatch cancel $(isomatch list --state queued --names))";

constexpr char kDeleteFooter[] = R"(
Forgets jobs that have ended, with their results.

Examples:
  isomatch delete jobs/4f1a...
  isomatch delete $(isomatch list --label study=spring --names))";

constexpr char kInfoFooter[] = R"(
Example:
  isomatch info --server meshes.example.org:7443 --tls-ca ca.crt)";

struct WatchArguments {
  std::string job;
  ConnectionFlags connection;
  bool json = false;
};

absl::Status RunWatch(const WatchArguments& arguments,
                      const Terminal& terminal) {
  ISOMATCH_ASSIGN_OR_RETURN(
      const RemoteServer server,
      RemoteServer::Contact(arguments.connection, terminal));
  ProgressDisplay display(
      terminal.err, ProgressStyleFor(terminal.is_interactive, arguments.json));
  const auto show = [&](const v1::Job& job) {
    display.Show(job);
    if (arguments.json) terminal.out << ToJsonLine(job) << std::flush;
  };
  const absl::StatusOr<v1::Job> job =
      server.client().Watch(FullJobName(arguments.job), show, terminal.stop);
  if (!job.ok()) return server.Explain(job.status());
  ISOMATCH_RETURN_IF_ERROR(OutcomeOf(*job));
  if (!arguments.json) {
    Warn(ResultWarnings(job->result()), terminal);
    TellVerdict(job->result().verdict(), /*quiet=*/false, terminal);
  }
  return absl::OkStatus();
}

struct ListArguments {
  std::vector<std::string> states;
  std::vector<std::string> labels;
  std::size_t limit = 100;
  ConnectionFlags connection;
  bool names = false;
  bool json = false;
};

absl::Status RunList(const ListArguments& arguments, const Terminal& terminal) {
  JobQuery query;
  query.limit = arguments.limit;
  for (const std::string& text : arguments.states) {
    ISOMATCH_ASSIGN_OR_RETURN(const v1::Job::State state, ParseState(text));
    query.states.push_back(state);
  }
  ISOMATCH_ASSIGN_OR_RETURN(query.labels,
                            ParseLabels("--label", arguments.labels));
  ISOMATCH_ASSIGN_OR_RETURN(
      const RemoteServer server,
      RemoteServer::Contact(arguments.connection, terminal));
  const absl::StatusOr<std::vector<v1::Job>> jobs =
      server.client().ListJobs(query, terminal.stop);
  if (!jobs.ok()) return server.Explain(jobs.status());
  if (!arguments.names && !arguments.json) {
    return Print(FormatJobs(*jobs, absl::Now()), terminal);
  }
  std::string text;
  for (const v1::Job& job : *jobs) {
    text += arguments.json ? ToJsonLine(job) : job.name() + "\n";
  }
  return Print(text, terminal);
}

struct JobsArguments {
  std::vector<std::string> jobs;
  ConnectionFlags connection;
  bool json = false;
};

// Does something to each of the jobs; returns the first thing that went wrong
// after all were tried.
template <typename Call>
absl::Status ForEachJob(const JobsArguments& arguments,
                        const Terminal& terminal, const Call& call) {
  ISOMATCH_ASSIGN_OR_RETURN(
      const RemoteServer server,
      RemoteServer::Contact(arguments.connection, terminal));
  IsomatchClient client = server.client();
  absl::Status first;
  for (const std::string& word : arguments.jobs) {
    const absl::Status status = call(client, FullJobName(word));
    if (status.ok()) continue;
    const absl::Status explained = server.Explain(status);
    // The command ends with the first error; the others are printed here.
    if (!first.ok()) Warn({std::string(explained.message())}, terminal);
    first.Update(explained);
    if (absl::IsUnavailable(status) || absl::IsCancelled(status)) break;
  }
  return first;
}

absl::Status RunCancel(const JobsArguments& arguments,
                       const Terminal& terminal) {
  return ForEachJob(arguments, terminal,
                    [&](IsomatchClient& client, const std::string& name) {
                      const auto job = client.CancelJob(name, terminal.stop);
                      return job.ok() && arguments.json
                                 ? Print(ToJsonLine(*job), terminal)
                                 : job.status();
                    });
}

std::string DeletedJson(const std::string& name) {
  return nlohmann::json({{"name", name}, {"deleted", true}}).dump() + "\n";
}

absl::Status RunDelete(const JobsArguments& arguments,
                       const Terminal& terminal) {
  return ForEachJob(arguments, terminal,
                    [&](IsomatchClient& client, const std::string& name) {
                      const absl::Status status =
                          client.DeleteJob(name, terminal.stop);
                      return status.ok() && arguments.json
                                 ? Print(DeletedJson(name), terminal)
                                 : status;
                    });
}

struct InfoArguments {
  ConnectionFlags connection;
  bool json = false;
};

absl::Status RunInfo(const InfoArguments& arguments, const Terminal& terminal) {
  ISOMATCH_ASSIGN_OR_RETURN(const RemoteServer server,
                            RemoteServer::Open(arguments.connection, terminal));
  const absl::StatusOr<v1::GetServerInfoResponse> info =
      server.client().GetServerInfo(terminal.stop);
  if (!info.ok()) return server.Explain(info.status());
  return Print(arguments.json ? ToJsonLine(*info) : FormatServerInfo(*info),
               terminal);
}

Command AddJobsCommand(CLI::App& app, const std::string& name,
                       const std::string& description,
                       const std::string& footer,
                       absl::Status (*run)(const JobsArguments&,
                                           const Terminal&)) {
  CLI::App* command = app.add_subcommand(name, description);
  const auto arguments = std::make_shared<JobsArguments>();
  command->add_option("JOB", arguments->jobs, "Name, as `submit` printed it")
      ->required()
      ->type_name("");
  AddConnectionFlags(command, &arguments->connection, ServerUse::kNeeded);
  command->add_flag("--json", arguments->json,
                    "Print each job that it was done to as JSON in a line");
  command->footer(footer);
  return {command, [arguments, run](const Terminal& terminal) {
            return run(*arguments, terminal);
          }};
}

}  // namespace

Command AddWatchCommand(CLI::App& app) {
  CLI::App* command =
      app.add_subcommand("watch", "Shows a job's progress until it ends.");
  const auto arguments = std::make_shared<WatchArguments>();
  command->add_option("JOB", arguments->job, "Name, as `submit` printed it")
      ->required()
      ->type_name("");
  AddConnectionFlags(command, &arguments->connection, ServerUse::kNeeded);
  command->add_flag("--json", arguments->json,
                    "Print each snapshot as JSON in a line of its own");
  command->footer(kWatchFooter);
  return {command, [arguments](const Terminal& terminal) {
            return RunWatch(*arguments, terminal);
          }};
}

Command AddListCommand(CLI::App& app) {
  CLI::App* command = app.add_subcommand("list", "Lists the server's jobs.");
  const auto arguments = std::make_shared<ListArguments>();
  command
      ->add_option("--state", arguments->states,
                   "Jobs in this state; may be repeated")
      ->type_name("STATE:{queued,running,succeeded,failed,cancelled}");
  command
      ->add_option("--label", arguments->labels,
                   "Jobs that have it; may be repeated")
      ->type_name("KEY=VALUE");
  command
      ->add_option("--limit", arguments->limit, "List at most this many jobs")
      ->check(WholeNumber(1, 1'000'000))
      ->type_name("COUNT")
      ->capture_default_str();
  AddConnectionFlags(command, &arguments->connection, ServerUse::kNeeded);
  CLI::Option* const names =
      command->add_flag("--names", arguments->names, "Print the names alone");
  command
      ->add_flag("--json", arguments->json,
                 "Print each job as JSON in a line of its own")
      ->excludes(names);
  command->footer(kListFooter);
  return {command, [arguments](const Terminal& terminal) {
            return RunList(*arguments, terminal);
          }};
}

Command AddCancelCommand(CLI::App& app) {
  return AddJobsCommand(app, "cancel", "Asks jobs to stop.", kCancelFooter,
                        RunCancel);
}

Command AddDeleteCommand(CLI::App& app) {
  return AddJobsCommand(app, "delete", "Forgets jobs and their results.",
                        kDeleteFooter, RunDelete);
}

Command AddInfoCommand(CLI::App& app) {
  CLI::App* command =
      app.add_subcommand("info", "Shows a server's version, limits and load.");
  const auto arguments = std::make_shared<InfoArguments>();
  AddConnectionFlags(command, &arguments->connection, ServerUse::kNeeded);
  command->add_flag("--json", arguments->json, "Print JSON instead of text");
  command->footer(kInfoFooter);
  return {command, [arguments](const Terminal& terminal) {
            return RunInfo(*arguments, terminal);
          }};
}

}  // namespace isomatch
