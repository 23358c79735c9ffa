#include "core/base/nearest_columns.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <limits>
#include <vector>

#include "core/base/parallel.h"
#include "core/base/status_macros.h"

namespace isomatch {
namespace {

constexpr Eigen::Index kQueryBlock = 64;
/// Points in a group: points that follow each other, which a search passes over
/// together when none can be nearest.
constexpr Eigen::Index kGroup = 8;
/// Groups searched at a time, so that the table of their distances stays small
/// however many there are.
constexpr Eigen::Index kGroupsAtATime = 4096;
/// Most columns of a product, so that it stays in the second-level cache.
constexpr Eigen::Index kPointBlock = 512;
/// As a fraction of squared lengths: the most that products in single precision
/// are wrong by.
constexpr float kRounding = 1e-5f;

/// Points in groups of kGroup, each within a ball.
struct Groups {
  explicit Groups(const PointColumns& points)
      : centers(points.rows(), (points.cols() + kGroup - 1) / kGroup),
        radii(centers.cols()),
        norms(centers.cols()) {
    for (Eigen::Index g = 0; g < centers.cols(); ++g) {
      const Eigen::Index begin = g * kGroup;
      const auto members =
          points.middleCols(begin, std::min(kGroup, points.cols() - begin));
      centers.col(g) = members.rowwise().mean();
      radii[g] = std::sqrt((members.colwise() - centers.col(g))
                               .colwise()
                               .squaredNorm()
                               .maxCoeff());
    }
    norms = centers.colwise().squaredNorm().transpose();
  }

  PointColumns centers;
  Eigen::VectorXf radii;
  Eigen::VectorXf norms;  ///< squared, of the centers
};

/// Nearest points of one block of queries.
class BlockSearch {
 public:
  BlockSearch(const PointColumns& points, const Groups& groups,
              const Eigen::VectorXf& half_norms)
      : points_(points), groups_(groups), half_norms_(half_norms) {}

  void Search(const Eigen::Ref<const PointColumns>& queries,
              VertexIndex* nearest) {
    const Eigen::Index count = queries.cols();
    best_.assign(count, std::numeric_limits<float>::infinity());
    std::fill(nearest, nearest + count, 0);
    norms_ = queries.colwise().squaredNorm().transpose();
    const Eigen::Index groups = groups_.radii.size();
    for (Eigen::Index first = 0; first < groups; first += kGroupsAtATime) {
      SearchGroups(queries, first, std::min(kGroupsAtATime, groups - first),
                   nearest);
    }
  }

 private:
  /// Among `width` groups from `first` on.
  void SearchGroups(const Eigen::Ref<const PointColumns>& queries,
                    Eigen::Index first, Eigen::Index width,
                    VertexIndex* nearest) {
    // Squared distances of the queries from the groups' centers.
    squared_.noalias() =
        -2 * groups_.centers.middleCols(first, width).transpose() * queries;
    squared_.colwise() += groups_.norms.segment(first, width);
    squared_.rowwise() += norms_.transpose();
    // The groups next to a query hold a point that is near already.
    std::vector<char> taken(width, false);
    for (Eigen::Index q = 0; q < queries.cols(); ++q) {
      Eigen::Index group;
      squared_.col(q).minCoeff(&group);
      taken[group] = true;
    }
    Compare(queries, first, taken, nearest);
    for (Eigen::Index g = 0; g < width; ++g) {
      taken[g] = !taken[g] && MayHoldNearer(first, g);
    }
    Compare(queries, first, taken, nearest);
  }

  bool MayHoldNearer(Eigen::Index first, Eigen::Index group) const {
    const float radius = groups_.radii[first + group];
    for (Eigen::Index q = 0; q < norms_.size(); ++q) {
      const float unsure =
          kRounding * (norms_[q] + groups_.norms[first + group]);
      // |q - p|^2, known as |p|^2 / 2 - q.p.
      const float least = std::max(norms_[q] + 2 * best_[q], 0.0f);
      const float reach = std::sqrt(least + unsure) + radius;
      if (!(squared_(group, q) > reach * reach + unsure)) return true;
    }
    return false;
  }

  void Compare(const Eigen::Ref<const PointColumns>& queries,
               Eigen::Index first, const std::vector<char>& taken,
               VertexIndex* nearest) {
    for (std::size_t g = 0; g < taken.size();) {
      chosen_.clear();
      for (; g < taken.size() &&
             static_cast<Eigen::Index>(chosen_.size()) + kGroup <= kPointBlock;
           ++g) {
        if (!taken[g]) continue;
        const auto begin = (first + static_cast<Eigen::Index>(g)) * kGroup;
        const Eigen::Index end = std::min(begin + kGroup, points_.cols());
        for (Eigen::Index p = begin; p < end; ++p) {
          chosen_.push_back(static_cast<VertexIndex>(p));
        }
      }
      if (!chosen_.empty()) CompareChosen(queries, nearest);
    }
  }

  void CompareChosen(const Eigen::Ref<const PointColumns>& queries,
                     VertexIndex* nearest) {
    gathered_ = points_(Eigen::all, chosen_);
    // |q - p|^2 = |q|^2 + 2 (|p|^2 / 2 - q.p), and |q|^2 does not matter.
    scores_.noalias() = -gathered_.transpose() * queries;
    scores_.colwise() += half_norms_(chosen_);
    for (Eigen::Index q = 0; q < queries.cols(); ++q) {
      // The value alone is found many times faster than its place.
      const float score = scores_.col(q).minCoeff();
      if (!(score <= best_[q])) continue;
      const float* const column = scores_.col(q).data();
      const VertexIndex found =
          chosen_[std::find(column, column + scores_.rows(), score) - column];
      if (score == best_[q] && found > nearest[q]) continue;
      best_[q] = score;
      nearest[q] = found;
    }
  }

  const PointColumns& points_;
  const Groups& groups_;
  const Eigen::VectorXf& half_norms_;
  Eigen::VectorXf norms_;    ///< squared, of the queries
  std::vector<float> best_;  ///< of each query, |p|^2 / 2 - q.p
  Eigen::MatrixXf squared_;
  std::vector<VertexIndex> chosen_;
  PointColumns gathered_;
  Eigen::MatrixXf scores_;
};

}  // namespace

absl::StatusOr<VertexMap> NearestColumns(const PointColumns& queries,
                                         const PointColumns& points,
                                         const std::stop_token& stop) {
  assert(queries.rows() == points.rows() && points.cols() > 0);
  const Eigen::VectorXf half_norms =
      0.5f * points.colwise().squaredNorm().transpose();
  const Groups groups(points);
  VertexMap nearest(queries.cols());
  const Eigen::Index blocks = (queries.cols() + kQueryBlock - 1) / kQueryBlock;
  ISOMATCH_RETURN_IF_ERROR(ParallelFor(blocks, stop, [&](std::int64_t block) {
    const Eigen::Index begin = block * kQueryBlock;
    const Eigen::Index count = std::min(kQueryBlock, queries.cols() - begin);
    BlockSearch(points, groups, half_norms)
        .Search(queries.middleCols(begin, count), nearest.data() + begin);
  }));
  return nearest;
}

}  // namespace isomatch
