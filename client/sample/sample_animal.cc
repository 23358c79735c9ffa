#include "client/sample/sample_animal.h"

#include <algorithm>
#include <cassert>
#include <cstddef>
#include <functional>
#include <numeric>
#include <stop_token>
#include <utility>
#include <vector>

#include <nanoflann.hpp>

#include "absl/status/status.h"
#include "absl/strings/str_cat.h"
#include "client/sample/animal_body.h"
#include "client/sample/surface_mesher.h"
#include "core/base/parallel.h"
#include "core/base/random_stream.h"
#include "core/base/status_macros.h"

namespace isomatch {
namespace {

// The rows of positions, for nearest neighbors.
using PointTree =
    nanoflann::KDTreeEigenMatrixAdaptor<Positions, 3, nanoflann::metric_L2>;

// Fisher and Yates.
std::vector<VertexIndex> RandomOrder(VertexIndex count, RandomStream& random) {
  std::vector<VertexIndex> order(static_cast<std::size_t>(count));
  std::iota(order.begin(), order.end(), 0);
  for (VertexIndex i = count - 1; i > 0; --i) {
    std::swap(order[static_cast<std::size_t>(i)],
              order[static_cast<std::size_t>(random.Below(i + 1))]);
  }
  return order;
}

TriangleMesh Shuffled(const TriangleMesh& mesh, RandomStream& random) {
  const std::vector<VertexIndex> new_from_old =
      RandomOrder(mesh.num_vertices(), random);
  TriangleMesh shuffled = mesh;
  for (VertexIndex v = 0; v < mesh.num_vertices(); ++v) {
    shuffled.positions.row(new_from_old[static_cast<std::size_t>(v)]) =
        mesh.positions.row(v);
  }
  for (VertexIndex& corner : shuffled.faces.reshaped()) {
    corner = new_from_old[static_cast<std::size_t>(corner)];
  }
  return shuffled;
}

// Calls body(v) for each row, in blocks on several threads.
template <typename Body>
void ForEachRow(Eigen::Index rows, const Body& body) {
  constexpr Eigen::Index kBlock = 4096;
  const absl::Status status = ParallelFor(
      (rows + kBlock - 1) / kBlock, std::stop_token(), [&](std::int64_t block) {
        const Eigen::Index end =
            std::min<Eigen::Index>((block + 1) * kBlock, rows);
        for (Eigen::Index v = block * kBlock; v < end; ++v) {
          body(v);
        }
      });
  assert(status.ok());
}

}  // namespace

absl::Status SampleOptions::Validate() const {
  if (pose < 'A' || pose > 'C') {
    return absl::InvalidArgumentError(absl::StrCat(
        "pose is '", std::string(1, pose), "', expected A, B or C"));
  }
  if (vertices < kMinVertices || vertices > kMaxVertices) {
    return absl::InvalidArgumentError(absl::StrCat("vertices is ", vertices,
                                                   ", expected ", kMinVertices,
                                                   " to ", kMaxVertices));
  }
  return absl::OkStatus();
}

absl::StatusOr<Sample> MakeSample(const SampleOptions& options) {
  ISOMATCH_RETURN_IF_ERROR(options.Validate());
  const AnimalBody body;
  RandomStream random(options.mesh_seed,
                      static_cast<std::uint64_t>(options.pose));
  ISOMATCH_ASSIGN_OR_RETURN(const TriangleMesh at_rest,
                            MeshSurface(body, options.vertices, random));
  Sample sample;
  sample.mesh = Shuffled(at_rest, random);
  sample.rest = sample.mesh.positions;
  const AnimalPose pose(body, options.pose);
  ForEachRow(sample.rest.rows(), [&](Eigen::Index v) {
    sample.mesh.positions.row(v) = pose(sample.rest.row(v));
  });
  return sample;
}

VertexMap SampleTruth(const Sample& x, const Sample& y) {
  const PointTree tree(3, std::cref(y.rest));
  VertexMap y_from_x(static_cast<std::size_t>(x.rest.rows()));
  ForEachRow(x.rest.rows(), [&](Eigen::Index v) {
    const Eigen::Vector3d query = x.rest.row(v);
    Eigen::Index nearest = 0;
    double squared = 0;
    tree.index->knnSearch(query.data(), 1, &nearest, &squared);
    y_from_x[static_cast<std::size_t>(v)] = static_cast<VertexIndex>(nearest);
  });
  return y_from_x;
}

}  // namespace isomatch
