// Carries what Y has at its vertices to X: transfer_texture X Y OUT.off
//
// Here Y is painted with stripes and smooth coordinates along its longest axis;
// X, another pose with another triangulation, gets both through the map.
// OUT.off is X with colors: open it in MeshLab.
//
// ISOMATCH_SERVER=HOST:PORT names another server than 127.0.0.1:7443.

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdlib>
#include <fstream>
#include <iostream>
#include <string>
#include <utility>
#include <vector>

#include <isomatch/client/api/connection.h>
#include <isomatch/client/api/isomatch_client.h>
#include <isomatch/client/files/mesh_file.h>

namespace {

namespace v1 = isomatch::v1;

std::string ServerAddress() {
  const char* const address = std::getenv("ISOMATCH_SERVER");
  return address != nullptr ? address : "127.0.0.1:7443";
}

/// A texture coordinate: 0 at one end of the longest axis, 1 at the other.
std::vector<double> Unwrap(const isomatch::TriangleMesh& mesh) {
  const Eigen::RowVector3d low = mesh.positions.colwise().minCoeff();
  const Eigen::RowVector3d span = mesh.positions.colwise().maxCoeff() - low;
  Eigen::Index axis = 0;
  span.maxCoeff(&axis);
  std::vector<double> along;
  for (Eigen::Index v = 0; v < mesh.positions.rows(); ++v) {
    along.push_back((mesh.positions(v, axis) - low[axis]) / span[axis]);
  }
  return along;
}

/// Smooth values lie between three vertices of Y. (Where texture coordinates
/// have seams, take y_from_x: there is nothing between.)
std::vector<double> Transfer(
    const std::vector<double>& on_y,
    const std::vector<isomatch::PrecisePoint>& places) {
  std::vector<double> on_x;
  for (const isomatch::PrecisePoint& place : places) {
    double value = 0;
    for (std::size_t i = 0; i < 3; ++i) {
      if (place.vertices[i] == isomatch::kNoVertex) continue;
      value += place.weights[i] * on_y[place.vertices[i]];
    }
    on_x.push_back(value);
  }
  return on_x;
}

std::string FormatOff(const isomatch::TriangleMesh& mesh,
                      const std::vector<double>& along) {
  constexpr std::array kColors = {"230 80 60", "250 220 120", "60 110 180"};
  std::string text = "COFF\n" + std::to_string(mesh.positions.rows()) + " " +
                     std::to_string(mesh.faces.rows()) + " 0\n";
  for (Eigen::Index v = 0; v < mesh.positions.rows(); ++v) {
    for (int axis = 0; axis < 3; ++axis) {
      text += std::to_string(mesh.positions(v, axis)) + " ";
    }
    const auto stripe = static_cast<std::size_t>(12 * along[v]);
    text += std::string(kColors[stripe % kColors.size()]) + " 255\n";
  }
  for (Eigen::Index f = 0; f < mesh.faces.rows(); ++f) {
    text += "3";
    for (int corner = 0; corner < 3; ++corner) {
      text += " " + std::to_string(mesh.faces(f, corner));
    }
    text += "\n";
  }
  return text;
}

absl::Status TransferTexture(const std::string& path_x,
                             const std::string& path_y,
                             const std::string& output) {
  absl::StatusOr<isomatch::LoadedMesh> x = isomatch::ReadMesh(path_x, "X");
  if (!x.ok()) return x.status();
  absl::StatusOr<isomatch::LoadedMesh> y = isomatch::ReadMesh(path_y, "Y");
  if (!y.ok()) return y.status();

  isomatch::MatchRequest request;
  request.mesh_x = std::move(x->mesh);
  request.mesh_y = std::move(y->mesh);
  request.parts = {v1::RESULT_PART_PRECISE_MAP};
  isomatch::IsomatchClient client(isomatch::ConnectTo(ServerAddress()));
  const absl::StatusOr<isomatch::MatchResult> result = client.Match(request);
  if (!result.ok()) return result.status();

  std::ofstream file(output);
  file << FormatOff(request.mesh_x,
                    Transfer(Unwrap(request.mesh_y), *result->precise));
  if (!file.flush()) return absl::UnavailableError(output + ": not written");
  std::cout << output << ": " << request.mesh_x.num_vertices()
            << " vertices with the colors of " << path_y << "\n";
  return absl::OkStatus();
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 4) {
    std::cerr << "usage: transfer_texture X Y OUT.off\n";
    return 2;
  }
  const absl::Status status = TransferTexture(argv[1], argv[2], argv[3]);
  if (!status.ok()) std::cerr << status.message() << "\n";
  return status.ok() ? 0 : 1;
}
