#include "core/pipeline/landmarks.h"

#include <algorithm>
#include <cmath>
#include <set>
#include <unordered_map>
#include <utility>

#include "absl/strings/str_cat.h"
#include "core/base/status_macros.h"

namespace isomatch {
namespace {

/// Landmarks beyond this many are thinned out evenly: they hold the map as well
/// and cost their square.
constexpr std::size_t kMaxLandmarks = 1000;
/// Two landmarks agree when their distances differ by less than this fraction
/// of the larger one, and this fraction of sqrt(area).
constexpr float kRelativeTolerance = 0.1f;
constexpr float kAbsoluteTolerance = 0.08f;
/// With this many known matches, seeds add little: fewer are tried.
constexpr std::size_t kManyLandmarks = 30;
constexpr std::size_t kSeedsBesideMany = 50;
/// With this many that agree, few maps start without them: enough to repair
/// what they agree wrongly on, too few to crowd them out.
constexpr std::size_t kSomeLandmarks = 4;
constexpr std::size_t kSeedsWithoutThem = 20;

/// Middle of the bounds of Eq. 6.
float About(const BasisPoints& basis, VertexIndex u, VertexIndex v) {
  return 0.5f * (basis.LowerBound(u, v) + basis.UpperBound(u, v));
}

bool Agree(const BasisPoints& basis_x, const BasisPoints& basis_y,
           const VertexMatch& a, const VertexMatch& b) {
  const float on_x = About(basis_x, a.x, b.x);
  const float on_y = About(basis_y, a.y, b.y);
  return std::abs(on_x - on_y) <=
         kAbsoluteTolerance + kRelativeTolerance * std::max(on_x, on_y);
}

}  // namespace

absl::StatusOr<std::vector<WorkingLandmark>> TakeLandmarks(
    absl::Span<const VertexMatch> landmarks, const PreparedMesh& x,
    const PreparedMesh& y, std::vector<std::string>* warnings) {
  std::vector<WorkingLandmark> taken;
  std::set<VertexIndex> full_x;
  std::set<VertexIndex> full_y;
  std::set<VertexIndex> taken_x;
  std::set<VertexIndex> taken_y;
  const std::size_t given = landmarks.size();
  const std::size_t used = std::min(given, kMaxLandmarks);
  for (std::size_t k = 0; k < used; ++k) {
    const std::size_t i = k * given / used;
    const VertexIndex in_x = x.full.working_from_user[landmarks[i].x];
    const VertexIndex in_y = y.full.working_from_user[landmarks[i].y];
    if (in_x == kNoVertex || in_y == kNoVertex) {
      return absl::InvalidArgumentError(absl::StrCat(
          "landmarks[", i, "].", in_x == kNoVertex ? "x" : "y",
          ": the vertex is on no face, expected one of the surface"));
    }
    if (full_x.count(in_x) > 0 || full_y.count(in_y) > 0) {
      warnings->push_back(absl::StrCat("landmarks[", i,
                                       "] left out: its vertex coincides with "
                                       "that of an earlier landmark"));
      continue;
    }
    full_x.insert(in_x);
    full_y.insert(in_y);
    const VertexMatch match = {x.solved().working_from_user[landmarks[i].x],
                               y.solved().working_from_user[landmarks[i].y]};
    const bool follows =
        taken_x.count(match.x) > 0 || taken_y.count(match.y) > 0;
    taken.push_back({match, i, follows});
    if (follows) continue;
    taken_x.insert(match.x);
    taken_y.insert(match.y);
  }
  if (used < given) {
    warnings->push_back(absl::StrCat(used, " of ", given,
                                     " landmarks used, evenly from the list"));
  }
  return taken;
}

std::vector<VertexIndex> VerticesOf(
    const std::vector<WorkingLandmark>& landmarks, Side side) {
  std::vector<VertexIndex> vertices;
  for (const auto& [match, index, follows] : landmarks) {
    if (!follows) vertices.push_back(side == kX ? match.x : match.y);
  }
  return vertices;
}

std::vector<VertexMatch> AgreeingLandmarks(
    const std::vector<WorkingLandmark>& landmarks, const BasisPoints& basis_x,
    const BasisPoints& basis_y) {
  const std::size_t count = landmarks.size();
  std::vector<char> agrees(count * count, false);
  std::vector<std::size_t> friends(count, 0);
  for (std::size_t i = 0; i < count; ++i) {
    for (std::size_t j = 0; j < i; ++j) {
      if (!Agree(basis_x, basis_y, landmarks[i].match, landmarks[j].match)) {
        continue;
      }
      agrees[i * count + j] = agrees[j * count + i] = true;
      ++friends[i];
      ++friends[j];
    }
  }
  std::vector<char> present(count, true);
  for (std::size_t left = count; left > 2; --left) {
    std::size_t worst = count;
    for (std::size_t i = 0; i < count; ++i) {
      if (present[i] && (worst == count || friends[i] <= friends[worst])) {
        worst = i;
      }
    }
    if (2 * friends[worst] >= left - 1) break;
    present[worst] = false;
    for (std::size_t i = 0; i < count; ++i) {
      if (agrees[worst * count + i]) --friends[i];
    }
  }
  std::vector<VertexMatch> result;
  for (std::size_t i = 0; i < count; ++i) {
    if (present[i]) result.push_back(landmarks[i].match);
  }
  return result;
}

std::vector<Seed> SeedsWithLandmarks(const Seed& given,
                                     const std::vector<Seed>& generated,
                                     bool exact) {
  if (given.empty()) return generated;
  std::vector<Seed> seeds = {given};
  const std::size_t count = given.size() >= kManyLandmarks
                                ? std::min(kSeedsBesideMany, generated.size())
                                : generated.size();
  std::size_t alone = exact ? 0 : count / 2;
  if (given.size() >= kSomeLandmarks) {
    alone = std::min(alone, kSeedsWithoutThem);
  }
  for (std::size_t i = 0; i < count; ++i) {
    Seed both = given;
    for (const PointMatch& match : generated[i]) {
      const bool free = std::none_of(
          given.begin(), given.end(), [&](const PointMatch& other) {
            return other.x == match.x || other.y == match.y;
          });
      if (free) both.push_back(match);
    }
    seeds.push_back(std::move(both));
    if (i < alone) seeds.push_back(generated[i]);
  }
  return seeds;
}

}  // namespace isomatch
