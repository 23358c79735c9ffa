#pragma once

#include <cstddef>
#include <vector>

#include "core/base/vertex_index.h"
#include "core/geodesic/basis_points.h"
#include "core/pipeline/correspondence.h"
#include "core/pipeline/match_options.h"

namespace isomatch {

/// What speaks against a map after the first rounds of the elastic alignment.
struct FirstSigns {
  double stretch = 0;
  double normals = 0;  ///< AlignmentScore::normal_mismatch
  double moved = 0;    ///< mean way of images since the filter, sqrt(area)
};

/// A whole map that may be the result, as it grows. On working vertices.
struct Candidate {
  std::vector<VertexMatch> sparse;
  VertexMap y_from_x;
  VertexMap filtered;  ///< y_from_x before the elastic alignment
  /// Not 0 for the vertices of X that have a counterpart; empty: all.
  std::vector<char> matched;
  MapScores scores;
  double objective = 0;  ///< Eq. 4
  /// Mean squared difference of descriptors along the dense map, before
  /// anything is refined.
  double dense_mismatch = 0;
  FirstSigns first_signs;
  /// Given up after the first rounds.
  bool is_lost = false;
};

/// The rank value of a map of whole shapes: curvature^2 (curvature_weight
/// times) x dense_mismatch^4 x first_signs.stretch x normals x descriptors^2,
/// the last two after the judged rounds, each 0 of a perfect map; where
/// surfaces are not oriented, the stretch after those in place of the normals.
/// How well sparse matches keep distances (Eq. 8) is not in it: among maps that
/// came so far it tells nothing more (core/EXPERIMENTS.md, "Choice among
/// distinct maps"). Of a part the stretch of Y x normals x descriptors, all
/// after the judged rounds. Not in the paper.
double MisfitOf(const Candidate& candidate, bool oriented,
                const MatchOptions& options);

/// Whether a map need not be looked at further: by all first signs together,
/// and by normals and movement, which are independent, each alone.
bool IsFarBehind(const FirstSigns& signs, const FirstSigns& leading);

/// By rank value; those that are lost come last.
bool RanksBefore(const Candidate& a, const Candidate& b);

/// Those that are lost get the least rank value that is known of them.
/// REQUIRES: sorted, the first is not lost.
void RankLost(std::vector<Candidate>* candidates);

/// Share of X that two dense maps send to about the same places on Y, whose
/// basis is given.
double ShareInPlace(const BasisPoints& basis_y, const VertexMap& a,
                    const VertexMap& b);

/// Leaves the first `count`. REQUIRES: there are as many.
void KeepFirst(std::size_t count, std::vector<Candidate>* candidates);

/// Leaves out those with a negative orientation score, unless all have one.
void DropMirrored(std::vector<Candidate>* candidates);

/// Of those that lead nearly all of X to about the same places on Y, whose
/// basis is given, leaves the first: what grew in two ways may end as one map,
/// which is no rival. REQUIRES: dense maps.
void DropRepeated(const BasisPoints& basis_y,
                  std::vector<Candidate>* candidates);

/// 1 - rank value of the best / of the next; 1 without a next, 0 when nothing
/// was compared. REQUIRES: sorted.
double SymmetryConfidence(const MatchOptions& options,
                          const std::vector<Candidate>& candidates);

}  // namespace isomatch
