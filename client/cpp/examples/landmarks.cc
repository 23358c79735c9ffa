// Known matches help where the shapes alone do not decide: landmarks X Y PAIRS
//
// PAIRS has lines `x y`, 0-based vertices of X and Y that belong together. A
// landmark that the rest of the map contradicts is changed, and we say so;
// landmarks_exact would keep it.
//
// ISOMATCH_SERVER=HOST:PORT names another server than 127.0.0.1:7443.

#include <cstdlib>
#include <iostream>
#include <string>
#include <utility>
#include <vector>

#include <isomatch/client/api/connection.h>
#include <isomatch/client/api/isomatch_client.h>
#include <isomatch/client/files/map_file.h>
#include <isomatch/client/files/mesh_file.h>

namespace {

std::string ServerAddress() {
  const char* const address = std::getenv("ISOMATCH_SERVER");
  return address != nullptr ? address : "127.0.0.1:7443";
}

void Print(const isomatch::v1::LandmarkOutcome& outcome) {
  std::cout << outcome.landmark().x() << " -> " << outcome.landmark().y();
  if (outcome.kept()) {
    std::cout << ": kept\n";
  } else {
    std::cout << ": contradicted, the map says " << outcome.y_found() << " ("
              << outcome.distance() << " away)\n";
  }
}

absl::Status MatchWithLandmarks(const std::string& path_x,
                                const std::string& path_y,
                                const std::string& pairs) {
  absl::StatusOr<isomatch::LoadedMesh> x = isomatch::ReadMesh(path_x, "X");
  if (!x.ok()) return x.status();
  absl::StatusOr<isomatch::LoadedMesh> y = isomatch::ReadMesh(path_y, "Y");
  if (!y.ok()) return y.status();
  // "'pairs.txt', line 4: vertex 9999 of Y, ...", for one, when it is wrong.
  absl::StatusOr<std::vector<isomatch::VertexMatch>> landmarks =
      isomatch::ReadLandmarks(pairs, x->mesh.num_vertices(),
                              y->mesh.num_vertices());
  if (!landmarks.ok()) return landmarks.status();

  isomatch::MatchRequest request;
  request.mesh_x = std::move(x->mesh);
  request.mesh_y = std::move(y->mesh);
  request.landmarks = *std::move(landmarks);
  isomatch::IsomatchClient client(isomatch::ConnectTo(ServerAddress()));
  const absl::StatusOr<isomatch::MatchResult> result = client.Match(request);
  if (!result.ok()) return result.status();
  for (const auto& outcome : result->info.landmarks()) Print(outcome);
  return absl::OkStatus();
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 4) {
    std::cerr << "usage: landmarks X Y PAIRS\n";
    return 2;
  }
  const absl::Status status = MatchWithLandmarks(argv[1], argv[2], argv[3]);
  if (!status.ok()) std::cerr << status.message() << "\n";
  return status.ok() ? 0 : 1;
}
