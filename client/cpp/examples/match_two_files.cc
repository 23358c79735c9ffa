// Two files in, the map out: match_two_files X Y MAP
//
//   isomatch-server --ephemeral &
//   isomatch sample --pose A --vertices 2000 -o a.off
//   isomatch sample --pose B --vertices 2000 -o b.off
//   match_two_files a.off b.off map.txt
//
// ISOMATCH_SERVER=HOST:PORT names another server than 127.0.0.1:7443.

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <iostream>
#include <string>
#include <utility>

#include <isomatch/client/api/connection.h>
#include <isomatch/client/api/isomatch_client.h>
#include <isomatch/client/files/map_file.h>
#include <isomatch/client/files/mesh_file.h>

namespace {

namespace v1 = isomatch::v1;

std::string ServerAddress() {
  const char* const address = std::getenv("ISOMATCH_SERVER");
  return address != nullptr ? address : "127.0.0.1:7443";
}

void Show(const v1::Job& job) {
  std::fprintf(stderr, "%3.0f %%  %s\n", 100 * job.progress().total_fraction(),
               v1::Stage_Name(job.progress().stage()).c_str());
}

absl::Status MatchFiles(const std::string& path_x, const std::string& path_y,
                        const std::string& output) {
  // OFF, OBJ, PLY or STL; vertices keep their numbers.
  absl::StatusOr<isomatch::LoadedMesh> x = isomatch::ReadMesh(path_x, "X");
  if (!x.ok()) return x.status();
  absl::StatusOr<isomatch::LoadedMesh> y = isomatch::ReadMesh(path_y, "Y");
  if (!y.ok()) return y.status();

  isomatch::MatchRequest request;
  request.mesh_x = std::move(x->mesh);
  request.mesh_y = std::move(y->mesh);
  request.parts = {v1::RESULT_PART_CONFIDENCE};
  isomatch::IsomatchClient client(isomatch::ConnectTo(ServerAddress()));
  const absl::StatusOr<isomatch::MatchResult> result =
      client.Match(request, Show);
  if (!result.ok()) return result.status();

  // Line i: the vertex of Y for vertex i of X, as `isomatch match` writes it.
  std::ofstream file(output);
  file << isomatch::FormatMap(result->y_from_x);
  if (!file.flush()) return absl::UnavailableError(output + ": not written");
  const auto matched = result->y_from_x.size() - result->info.unmatched();
  std::cout << matched << " of " << result->y_from_x.size()
            << " vertices matched\n";
  const v1::Verdict& verdict = result->info.verdict();
  std::cout << v1::Verdict::Level_Name(verdict.level()) << ": "
            << verdict.reason() << " " << verdict.advice() << "\n";
  const auto least = std::ranges::min_element(*result->confidence);
  std::cout << "least trusted vertex of X: "
            << least - result->confidence->begin() << ", confidence " << *least
            << "\n";
  return absl::OkStatus();
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 4) {
    std::cerr << "usage: match_two_files X Y MAP\n";
    return 2;
  }
  const absl::Status status = MatchFiles(argv[1], argv[2], argv[3]);
  if (!status.ok()) std::cerr << status.message() << "\n";
  return status.ok() ? 0 : 1;
}
