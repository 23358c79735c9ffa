#include "core/matching/second_stage.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "absl/types/span.h"
#include "core/base/parallel.h"
#include "core/base/status_macros.h"

namespace isomatch {
namespace {

/// Step 3: basis points added when there is no candidate.
constexpr int kGrowth = 3;
/// Insertions between two progress reports.
constexpr int kReportEvery = 64;
/// Anchors whose errors are added up before beaten candidates drop out.
constexpr std::size_t kAnchorsAtOnce = 4;

/// Vertices of X without a match, in random order.
std::vector<VertexIndex> ShuffledUnmatched(const VertexMap& y_from_x,
                                           RandomStream* random) {
  std::vector<VertexIndex> unmatched;
  for (std::size_t x = 0; x < y_from_x.size(); ++x) {
    if (y_from_x[x] == kNoVertex) {
      unmatched.push_back(static_cast<VertexIndex>(x));
    }
  }
  for (std::size_t i = unmatched.size(); i > 1; --i) {
    std::swap(unmatched[i - 1], unmatched[random->Below(i)]);
  }
  return unmatched;
}

/// A matched vertex of X near the one being inserted.
struct Anchor {
  float closeness;
  VertexIndex x;
};

class SecondStage {
 public:
  SecondStage(const HashedPair& shapes, const SecondStageOptions& options,
              PartialVertexMap* map)
      : shape_x_(shapes.x),
        shape_y_(shapes.y),
        options_(options),
        map_(*map),
        is_candidate_(map->x_from_y.size(), false) {}

  /// Matches one vertex; false when Y has no unmatched vertex left.
  bool Insert(VertexIndex x) {
    const int most = std::max(shape_x_.closeness.basis().num_points(),
                              shape_y_.closeness.basis().num_points());
    for (int count = kGrowth;; count += kGrowth) {
      const std::vector<Anchor> anchors = MatchedNear(x, count);
      std::vector<VertexIndex> candidates = Candidates(anchors, count);
      if (!candidates.empty()) {
        map_.Set(x, Best(anchors, std::move(candidates)));
        return true;
      }
      if (count >= most) return false;
    }
  }

 private:
  /// ME_X(x), the nearest max_matched of them, nearest first.
  std::vector<Anchor> MatchedNear(VertexIndex x, int count) const {
    std::vector<VertexIndex> matched;
    for (const VertexIndex v : MergedEnvironment(shape_x_, x, count)) {
      if (map_.y_from_x[v] != kNoVertex) matched.push_back(v);
    }
    std::vector<float> closeness(matched.size());
    shape_x_.closeness.Row(x, matched, closeness.data());
    std::vector<Anchor> anchors;
    for (std::size_t i = 0; i < matched.size(); ++i) {
      anchors.push_back({closeness[i], matched[i]});
    }
    const auto end =
        anchors.begin() +
        std::min<std::size_t>(options_.max_matched, anchors.size());
    std::partial_sort(anchors.begin(), end, anchors.end(),
                      [](const Anchor& a, const Anchor& b) {
                        return std::pair(-a.closeness, a.x) <
                               std::pair(-b.closeness, b.x);
                      });
    anchors.erase(end, anchors.end());
    return anchors;
  }

  /// Union of UE_Y over the anchors' images, up to max_candidates.
  std::vector<VertexIndex> Candidates(const std::vector<Anchor>& anchors,
                                      int count) {
    std::vector<VertexIndex> candidates;
    for (const Anchor& anchor : anchors) {
      for (const VertexIndex y :
           MergedEnvironment(shape_y_, map_.y_from_x[anchor.x], count)) {
        if (map_.x_from_y[y] != kNoVertex || is_candidate_[y]) continue;
        is_candidate_[y] = true;
        candidates.push_back(y);
      }
      if (static_cast<int>(candidates.size()) >= options_.max_candidates) break;
    }
    for (const VertexIndex y : candidates) is_candidate_[y] = false;
    std::sort(candidates.begin(), candidates.end());
    return candidates;
  }

  /// The candidate of least Eq. 8 over the anchors; ties by smallest vertex.
  VertexIndex Best(const std::vector<Anchor>& anchors,
                   std::vector<VertexIndex> candidates) const {
    std::vector<float> errors(candidates.size(), 0);
    for (std::size_t done = 0; done < anchors.size();) {
      const std::size_t end = std::min(done + kAnchorsAtOnce, anchors.size());
      const auto some = absl::MakeConstSpan(anchors).subspan(done, end - done);
      AddErrors(some, candidates, &errors);
      done = end;
      if (done < anchors.size() && candidates.size() > 1) {
        DropBeaten(absl::MakeConstSpan(anchors).subspan(done), &candidates,
                   &errors);
      }
    }
    const auto best = std::min_element(errors.begin(), errors.end());
    return candidates[best - errors.begin()];
  }

  void AddErrors(absl::Span<const Anchor> anchors,
                 const std::vector<VertexIndex>& candidates,
                 std::vector<float>* errors) const {
    std::vector<float> row(candidates.size());
    for (const Anchor& anchor : anchors) {
      shape_y_.closeness.Row(map_.y_from_x[anchor.x], candidates, row.data());
      for (std::size_t c = 0; c < candidates.size(); ++c) {
        (*errors)[c] += std::abs(anchor.closeness - row[c]);
      }
    }
  }

  /// Errors only grow: whoever has more by now than the best of now will have
  /// in the end cannot win.
  void DropBeaten(absl::Span<const Anchor> to_come,
                  std::vector<VertexIndex>* candidates,
                  std::vector<float>* errors) const {
    const std::size_t best =
        std::min_element(errors->begin(), errors->end()) - errors->begin();
    std::vector<float> bound = {(*errors)[best]};
    AddErrors(to_come, {(*candidates)[best]}, &bound);
    std::size_t kept = 0;
    for (std::size_t c = 0; c < candidates->size(); ++c) {
      if ((*errors)[c] > bound.front()) continue;
      (*candidates)[kept] = (*candidates)[c];
      (*errors)[kept++] = (*errors)[c];
    }
    candidates->resize(kept);
    errors->resize(kept);
  }

  const HashedShape& shape_x_;
  const HashedShape& shape_y_;
  const SecondStageOptions& options_;
  PartialVertexMap& map_;
  std::vector<char> is_candidate_;
};

}  // namespace

std::vector<VertexIndex> MergedEnvironment(const HashedShape& shape,
                                           VertexIndex v, int count) {
  std::vector<VertexIndex> merged;
  for (const int z : shape.closeness.basis().Nearest(v, count)) {
    const auto members = shape.environments[z];
    merged.insert(merged.end(), members.begin(), members.end());
  }
  std::sort(merged.begin(), merged.end());
  merged.erase(std::unique(merged.begin(), merged.end()), merged.end());
  return merged;
}

absl::Status RunSecondStage(const HashedPair& shapes,
                            const SecondStageOptions& options,
                            RandomStream* random, const Control& control,
                            PartialVertexMap* map) {
  const std::vector<VertexIndex> order =
      ShuffledUnmatched(map->y_from_x, random);
  const std::size_t smaller =
      std::min(map->y_from_x.size(), map->x_from_y.size());
  const std::size_t matched = map->y_from_x.size() - order.size();
  const auto wanted = static_cast<std::size_t>(options.fraction * smaller);
  const std::size_t count = wanted > matched ? wanted - matched : 0;
  SecondStage stage(shapes, options, map);
  for (std::size_t i = 0; i < count; ++i) {
    ISOMATCH_RETURN_IF_ERROR(CheckNotCancelled(control.stop));
    if (!stage.Insert(order[i])) break;
    if (control.progress && i % kReportEvery == 0) {
      control.progress(double(i + 1) / count);
    }
  }
  return CheckNotCancelled(control.stop);
}

}  // namespace isomatch
