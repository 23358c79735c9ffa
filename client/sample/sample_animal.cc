#include "client/sample/sample_animal.h"

#include <cassert>
#include <cmath>
#include <cstddef>
#include <limits>
#include <numeric>
#include <stop_token>
#include <utility>
#include <vector>

#include "absl/status/status.h"
#include "absl/strings/str_cat.h"
#include "client/sample/animal_body.h"
#include "client/sample/surface_mesher.h"
#include "core/base/parallel.h"
#include "core/base/random_stream.h"
#include "core/base/status_macros.h"

namespace isomatch {
namespace {

using Eigen::Vector3d;
using Cell = Eigen::Matrix<std::int64_t, 3, 1>;

// Points in a grid of cells, sorted by cell, for nearest neighbors.
class PointGrid {
 public:
  explicit PointGrid(const Positions& points)
      : points_(points),
        first_(points.colwise().minCoeff()),
        edge_(CellEdge(points)),
        size_(CellOf(points.colwise().maxCoeff()) + Cell::Ones()) {
    starts_.resize(static_cast<std::size_t>(size_.prod()) + 1);
    for (Eigen::Index v = 0; v < points.rows(); ++v) ++starts_[Slot(v) + 1];
    std::partial_sum(starts_.begin(), starts_.end(), starts_.begin());
    std::vector<std::size_t> next = starts_;
    members_.resize(static_cast<std::size_t>(points.rows()));
    for (Eigen::Index v = 0; v < points.rows(); ++v) {
      members_[next[Slot(v)]++] = static_cast<VertexIndex>(v);
    }
  }

  // The nearest point, ties by smallest index.
  VertexIndex Nearest(const Vector3d& query) const {
    Best best{std::numeric_limits<double>::infinity(), kNoVertex};
    const Cell center = CellOf(query);
    // Whatever lies outside of ring r is further than r - 1 edges.
    for (std::int64_t ring = 0; ring <= size_.sum(); ++ring) {
      const double reached = static_cast<double>(ring - 1) * edge_;
      if (ring > 0 && best.squared <= reached * reached) break;
      VisitRing(center, ring, query, best);
    }
    return best.vertex;
  }

 private:
  struct Best {
    double squared;
    VertexIndex vertex;
  };

  // About two points of a surface a cell.
  static double CellEdge(const Positions& points) {
    const Vector3d extent =
        points.colwise().maxCoeff() - points.colwise().minCoeff();
    return 2 * extent.maxCoeff() /
           std::sqrt(static_cast<double>(points.rows()));
  }

  Cell CellOf(const Vector3d& point) const {
    return ((point - first_) / edge_).array().floor().cast<std::int64_t>();
  }
  std::size_t SlotOf(const Cell& cell) const {
    return static_cast<std::size_t>((cell[2] * size_[1] + cell[1]) * size_[0] +
                                    cell[0]);
  }
  std::size_t Slot(Eigen::Index v) const {
    return SlotOf(CellOf(points_.row(v)));
  }

  // The cells at a distance of `ring` cells in the maximum norm.
  void VisitRing(const Cell& center, std::int64_t ring, const Vector3d& query,
                 Best& best) const {
    const Cell low = (center.array() - ring).max(0);
    const Cell high =
        (center + Cell::Constant(ring)).cwiseMin(size_ - Cell::Ones());
    for (std::int64_t z = low[2]; z <= high[2]; ++z) {
      for (std::int64_t y = low[1]; y <= high[1]; ++y) {
        for (std::int64_t x = low[0]; x <= high[0]; ++x) {
          const Cell cell(x, y, z);
          if ((cell - center).cwiseAbs().maxCoeff() == ring) {
            VisitCell(SlotOf(cell), query, best);
          }
        }
      }
    }
  }

  void VisitCell(std::size_t slot, const Vector3d& query, Best& best) const {
    for (std::size_t i = starts_[slot]; i < starts_[slot + 1]; ++i) {
      const VertexIndex v = members_[i];
      const double squared = (points_.row(v).transpose() - query).squaredNorm();
      if (std::pair(squared, v) < std::pair(best.squared, best.vertex)) {
        best = {squared, v};
      }
    }
  }

  const Positions& points_;
  Vector3d first_;
  double edge_;
  Cell size_;
  std::vector<std::size_t> starts_;
  std::vector<VertexIndex> members_;
};

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
  const PointGrid grid(y.rest);
  VertexMap y_from_x(static_cast<std::size_t>(x.rest.rows()));
  ForEachRow(x.rest.rows(), [&](Eigen::Index v) {
    y_from_x[static_cast<std::size_t>(v)] = grid.Nearest(x.rest.row(v));
  });
  return y_from_x;
}

}  // namespace isomatch
