// Start here, watch there, fetch elsewhere. In one terminal
//
//   isomatch-server --data-dir jobs &
//   watch_from_another_process start a.off b.off
//
// and in others, on any machine that reaches the server, now or tomorrow:
//
//   watch_from_another_process watch
//   watch_from_another_process fetch map.txt
//
// ISOMATCH_SERVER=HOST:PORT names another server than 127.0.0.1:7443.

#include <cmath>
#include <cstdlib>
#include <fstream>
#include <iostream>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include <isomatch/client/api/connection.h>
#include <isomatch/client/api/isomatch_client.h>
#include <isomatch/client/files/map_file.h>
#include <isomatch/client/files/mesh_file.h>

namespace {

namespace v1 = isomatch::v1;

const std::map<std::string, std::string> kLabels = {
    {"made-by", "watch_from_another_process"}};

std::string ServerAddress() {
  const char* const address = std::getenv("ISOMATCH_SERVER");
  return address != nullptr ? address : "127.0.0.1:7443";
}

absl::Status Start(isomatch::IsomatchClient& client, const std::string& path_x,
                   const std::string& path_y) {
  absl::StatusOr<isomatch::LoadedMesh> x = isomatch::ReadMesh(path_x, "X");
  if (!x.ok()) return x.status();
  absl::StatusOr<isomatch::LoadedMesh> y = isomatch::ReadMesh(path_y, "Y");
  if (!y.ok()) return y.status();
  isomatch::MatchRequest request;
  request.mesh_x = std::move(x->mesh);
  request.mesh_y = std::move(y->mesh);
  request.labels = kLabels;
  // The job goes on when we have gone.
  const absl::StatusOr<v1::Job> job = client.Submit(request);
  if (!job.ok()) return job.status();
  std::cout << job->name() << "\n";
  return absl::OkStatus();
}

void Show(const v1::Job& job) {
  std::cout << job.name() << "  " << v1::Job::State_Name(job.state()) << "  "
            << std::lround(100 * job.progress().total_fraction()) << " %  "
            << v1::Stage_Name(job.progress().stage()) << std::endl;
}

absl::Status Watch(isomatch::IsomatchClient& client,
                   const std::vector<v1::Job>& jobs) {
  for (const v1::Job& job : jobs) {
    const absl::StatusOr<v1::Job> ended = client.Watch(job.name(), Show);
    if (!ended.ok()) return ended.status();
  }
  return absl::OkStatus();
}

absl::Status Fetch(isomatch::IsomatchClient& client, const v1::Job& newest,
                   const std::string& output) {
  const absl::StatusOr<v1::Job> job = client.Watch(newest.name());
  if (!job.ok()) return job.status();
  const absl::Status outcome = isomatch::OutcomeOf(*job);
  if (!outcome.ok()) return outcome;
  const absl::StatusOr<isomatch::MatchResult> result =
      client.Fetch(*job, /*parts=*/{});
  if (!result.ok()) return result.status();
  std::ofstream file(output);
  file << isomatch::FormatMap(result->y_from_x);
  if (!file.flush()) return absl::UnavailableError(output + ": not written");
  std::cout << job->name() << ": " << result->y_from_x.size() << " vertices\n";
  return absl::OkStatus();
}

absl::Status Run(const std::vector<std::string>& words) {
  isomatch::IsomatchClient client(isomatch::ConnectTo(ServerAddress()));
  if (words.size() == 3 && words[0] == "start") {
    return Start(client, words[1], words[2]);
  }
  const bool watches = words.size() == 1 && words[0] == "watch";
  const bool fetches = words.size() == 2 && words[0] == "fetch";
  if (!watches && !fetches) {
    return absl::InvalidArgumentError(
        "usage: watch_from_another_process start X Y | watch | fetch MAP");
  }
  const absl::StatusOr<std::vector<v1::Job>> jobs =
      client.ListJobs({.states = {}, .labels = kLabels});  // newest first
  if (!jobs.ok()) return jobs.status();
  if (watches) return Watch(client, *jobs);
  if (jobs->empty()) return absl::NotFoundError("nothing was started");
  return Fetch(client, jobs->front(), words[1]);
}

}  // namespace

int main(int argc, char** argv) {
  const absl::Status status = Run({argv + 1, argv + argc});
  if (!status.ok()) std::cerr << status.message() << "\n";
  return status.ok() ? 0 : 1;
}
