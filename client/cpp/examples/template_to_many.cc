// One template against many meshes: template_to_many TEMPLATE FOLDER MESH...
//
// Writes FOLDER/NAME.txt for each mesh NAME.off: its vertex for each vertex of
// the template. All jobs are started at once and wait in the server's queue,
// which has room for 100 unless it is told otherwise; the server prepares the
// template once.
//
// ISOMATCH_SERVER=HOST:PORT names another server than 127.0.0.1:7443.

#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <string>
#include <utility>
#include <vector>

#include <isomatch/client/api/connection.h>
#include <isomatch/client/api/isomatch_client.h>
#include <isomatch/client/files/map_file.h>
#include <isomatch/client/files/mesh_file.h>

namespace {

namespace v1 = isomatch::v1;

struct Started {
  std::string name;
  v1::Job job;
};

std::string ServerAddress() {
  const char* const address = std::getenv("ISOMATCH_SERVER");
  return address != nullptr ? address : "127.0.0.1:7443";
}

absl::StatusOr<v1::Job> Start(isomatch::IsomatchClient& client,
                              const isomatch::TriangleMesh& mesh,
                              const std::string& path) {
  absl::StatusOr<isomatch::LoadedMesh> target = isomatch::ReadMesh(path, "Y");
  if (!target.ok()) return target.status();
  isomatch::MatchRequest request;
  request.mesh_x = mesh;  // a large one is sent once, and named after that
  request.mesh_y = std::move(target->mesh);
  return client.Submit(request);
}

absl::Status Save(isomatch::IsomatchClient& client, const Started& started,
                  const std::filesystem::path& folder) {
  const absl::StatusOr<v1::Job> job = client.Watch(started.job.name());
  if (!job.ok()) return job.status();
  const absl::Status outcome = isomatch::OutcomeOf(*job);
  if (!outcome.ok()) return outcome;
  const absl::StatusOr<isomatch::MatchResult> result =
      client.Fetch(*job, /*parts=*/{});
  if (!result.ok()) return result.status();
  const std::string output = folder / (started.name + ".txt");
  std::ofstream file(output);
  file << isomatch::FormatMap(result->y_from_x);
  if (!file.flush()) return absl::UnavailableError(output + ": not written");
  std::printf("%-20s distortion %.3f, %.1f s\n", started.name.c_str(),
              result->info.quality().geodesic_distortion(),
              result->info.run_seconds());
  return absl::OkStatus();
}

/// Returns how many meshes got no map.
absl::StatusOr<int> MatchAll(const std::string& path, const std::string& folder,
                             const std::vector<std::string>& targets) {
  const absl::StatusOr<isomatch::LoadedMesh> mesh =
      isomatch::ReadMesh(path, "TEMPLATE");
  if (!mesh.ok()) return mesh.status();
  isomatch::IsomatchClient client(isomatch::ConnectTo(ServerAddress()));
  std::vector<Started> jobs;
  int failed = 0;
  const auto tell = [&](const std::string& name, const absl::Status& status) {
    ++failed;
    std::cerr << name << ": " << status.message() << "\n";
  };
  for (const std::string& target : targets) {
    const std::string name = std::filesystem::path(target).stem();
    absl::StatusOr<v1::Job> job = Start(client, mesh->mesh, target);
    if (job.ok()) {
      jobs.push_back({name, *std::move(job)});
    } else {
      tell(name, job.status());
    }
  }
  for (const Started& started : jobs) {
    const absl::Status saved = Save(client, started, folder);
    if (!saved.ok()) tell(started.name, saved);
  }
  return failed;
}

}  // namespace

int main(int argc, char** argv) {
  if (argc < 4) {
    std::cerr << "usage: template_to_many TEMPLATE FOLDER MESH...\n";
    return 2;
  }
  const absl::StatusOr<int> failed =
      MatchAll(argv[1], argv[2], {argv + 3, argv + argc});
  if (!failed.ok()) std::cerr << failed.status().message() << "\n";
  return failed.ok() && *failed == 0 ? 0 : 1;
}
