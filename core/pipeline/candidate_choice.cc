#include "core/pipeline/candidate_choice.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <utility>

#include "core/base/parallel.h"
#include "core/base/status_macros.h"
#include "core/matching/first_stage.h"
#include "core/mesh/mesh_geometry.h"
#include "core/mesh/surface_samples.h"
#include "core/spectral/functional_map.h"
#include "core/spectral/wavelet_filter.h"

namespace isomatch {
namespace {

/// Rounds of alignment after which distinct maps are first looked at, and those
/// after which they are judged.
constexpr int kFirstRounds = 2;
constexpr int kJudgedRounds = 10;
/// Rounds between two stiffnesses.
constexpr int kRoundsPerStiffness = 2;
/// Scales of the wavelet filter, and the samples a side by which the map behind
/// it is looked for.
constexpr int kWaveletScales = 6;
constexpr std::int64_t kFilterSamples = 1500;
/// Maps that send this share of the vertices to one place are variants of each
/// other, not images by a symmetry of the whole.
constexpr double kPartlyOne = 0.2;
/// How far DescriptorOffsets looks, and for one of how many vertices: what it
/// finds is averaged over neighborhoods.
constexpr double kOffsetReach = 0.12;
constexpr std::int64_t kOffsetEvery = 3;
/// Of overlaps: how far from its image a vertex has its most alike one, at
/// first, sqrt(area).
constexpr double kAlikeReach = 0.03;
/// Of overlaps: how far a vertex may lie from its counterpart at first, and at
/// last, sqrt(area); steps of the surface once it is known which are pulled.
constexpr double kFirstTolerance = 0.1;
constexpr double kLastTolerance = 0.03;
constexpr int kNextSteps = 6;
/// Of parts: steps of the surface that is bent, which begins with vertices that
/// nothing pulls, before it is matched anew.
constexpr int kFirstSteps = 30;
/// Of parts: the last stiffness, of that of wholes.
constexpr double kPartsLastStiffness = 0.3;
/// Weight of eigenfunctions where X's rim shapes them more than X does.
constexpr double kRimSpectralWeight = 0.01;
/// Of overlaps: distortion and stretch that are none, and the open border that
/// doubles the rank value, sqrt(area).
constexpr double kLeastDistortion = 1e-3;
constexpr double kLeastStretch = 1e-5;
constexpr double kDoublingBorder = 1;

void KeepOnly(std::size_t one, std::vector<Candidate>* candidates) {
  std::swap(candidates->front(), (*candidates)[one]);
  KeepFirst(1, candidates);
}

AlignmentShape ShapeOf(const PreparedMesh& prepared,
                       const PointColumns& functions,
                       const std::vector<FaceLanes>* faces) {
  const WorkingMesh& solved = prepared.solved();
  return {solved.mesh, solved.normals, prepared.laplacian,
          functions,   solved.stars,   faces};
}

int BasisSize(const PreparedMesh& x, const PreparedMesh& y,
              const MatchOptions& options) {
  return std::min(
      {options.alignment_basis, x.spectral.size(), y.spectral.size()});
}

}  // namespace

CandidateChoice::CandidateChoice(const PreparedMesh& x, const PreparedMesh& y,
                                 const MatchOptions& options,
                                 const StopTokens& stops, bool is_mostly_rim)
    : functions_{FunctionColumns(x.spectral, BasisSize(x, y, options)),
                 FunctionColumns(y.spectral, BasisSize(x, y, options))},
      spectral_{&x.spectral, &y.spectral},
      basis_y_(y.hash.basis),
      x_(ShapeOf(x, functions_[kX], nullptr)),
      y_(ShapeOf(y, functions_[kY], &faces_y_)),
      surface_x_(SurfaceOf(x)),
      surface_y_(SurfaceOf(y)),
      oriented_(x.solved().oriented && y.solved().oriented),
      is_mostly_rim_(is_mostly_rim),
      options_(options),
      stop_(stops.stop),
      hurry_(stops.hurry),
      ball_{std::max(x.descriptor_radius, y.descriptor_radius),
            is_part() ? kFacing : ShotBall().least_cosine},
      descriptors_{&x.descriptors, &y.descriptors},
      prepared_radii_{x.descriptor_radius, y.descriptor_radius} {
  if (masks()) rule_.emplace(x, y, stop_);
}

/// Describes anew, with the larger radius, the mesh that was prepared with a
/// smaller one: the finer of the two. Of parts both, by what faces as the
/// described vertex does.
absl::Status CandidateChoice::DescribeAlike() {
  if (!described()) return absl::OkStatus();
  for (const Side side : {kX, kY}) {
    if (!is_part() && prepared_radii_[side] == ball_.radius) continue;
    ISOMATCH_ASSIGN_OR_RETURN(
        own_[side], DescribeShape(side == kX ? surface_x_ : surface_y_,
                                  kDescribedVertices, ball_, stop_));
    descriptors_[side] = &own_[side];
  }
  return absl::OkStatus();
}

absl::Status CandidateChoice::Compare() {
  if (!described() || compared_) return absl::OkStatus();
  ISOMATCH_ASSIGN_OR_RETURN(
      DescribedPair pair,
      PairDescriptors(*descriptors_[kX], {*descriptors_[kY], surface_y_},
                      stop_));
  compared_.emplace(std::move(pair));
  return absl::OkStatus();
}

/// Moves the images of vertices that are described to the most alike ones in
/// reach.
absl::Status CandidateChoice::MoveToAlike(double reach,
                                          VertexMap* y_from_x) const {
  if (!described()) return absl::OkStatus();
  ISOMATCH_ASSIGN_OR_RETURN(
      const VertexMap alike,
      MatchNearby(*compared_, *y_from_x, {.reach = reach}, stop_));
  for (std::size_t x = 0; x < alike.size(); ++x) {
    if (alike[x] != kNoVertex) (*y_from_x)[x] = alike[x];
  }
  return absl::OkStatus();
}

/// Of X, of the vertices that are described alone where there are any, as much
/// as all have.
Eigen::VectorXd CandidateChoice::DescribedMass() const {
  const Eigen::VectorXd& mass = x_.laplacian.mass;
  if (!described() || std::ssize(descriptors_[kX]->vertices) == mass.size()) {
    return mass;
  }
  Eigen::VectorXd of_described = Eigen::VectorXd::Zero(mass.size());
  for (const VertexIndex v : descriptors_[kX]->vertices) {
    of_described[v] = mass[v];
  }
  return of_described * (mass.sum() / of_described.sum());
}

/// Looks for the most alike vertices near the images, then lets the wavelet
/// filter find the smooth map behind those noisy matches. Of overlaps, whose
/// functions differ, the alignment has to find it.
absl::Status CandidateChoice::Filter(VertexMap* y_from_x) const {
  if (masks()) return MoveToAlike(kAlikeReach, y_from_x);
  const auto k = static_cast<int>(x_.functions.rows());
  const Eigen::MatrixXf filter =
      WaveletFilter(spectral_[kX]->eigenvalues.head(k),
                    spectral_[kY]->eigenvalues.head(k), kWaveletScales)
          .cast<float>();
  PointColumns carried(k, y_.functions.cols());
  const PointsOnSurface points_x = {x_.stars, x_.laplacian.mass, x_.functions};
  const PointsOnSurface points_y = {y_.stars, y_.laplacian.mass, carried};
  VertexMap matches = *y_from_x;
  if (options_.wavelet_rounds > 0) {
    ISOMATCH_RETURN_IF_ERROR(MoveToAlike(NearbyMatchOptions().reach, &matches));
  }
  for (int round = 0; round < options_.wavelet_rounds; ++round) {
    const Eigen::VectorXd mass =
        round == 0 ? DescribedMass() : x_.laplacian.mass;
    const Eigen::MatrixXf fmap_x_from_y =
        DenseFunctionalMap(x_.functions, mass, y_.functions, matches)
            .cwiseProduct(filter);
    CarryOver(fmap_x_from_y, y_.functions, carried);
    // The second map lies near the first one, those of parts near where they
    // were: their rims keep functions from telling places apart from afar.
    ISOMATCH_ASSIGN_OR_RETURN(
        matches,
        round == 0 && !is_part()
            ? NearestBySamples(points_x, points_y, kFilterSamples, stop_)
            : DescendFromMap(points_x, points_y, *y_from_x, stop_));
    *y_from_x = matches;
  }
  return absl::OkStatus();
}

absl::Status CandidateChoice::Mask(int round, double stiffness,
                                   ElasticAlignment* alignment) const {
  if (!masks()) return absl::OkStatus();
  const double left = 1 - double(round) / options_.alignment_rounds;
  std::vector<char> matched = rule_->Matched(
      *alignment, std::max(kLastTolerance, kFirstTolerance * left));
  ISOMATCH_RETURN_IF_ERROR(rule_->LeaveOutContradicting(*alignment, &matched));
  alignment->SetMatched(std::move(matched));
  return alignment->Settle(stiffness, kNextSteps, stop_);
}

absl::StatusOr<int> CandidateChoice::RunRounds(
    int begin, int end, const std::function<void(double)>& progress,
    ElasticAlignment* alignment) const {
  const double last =
      options_.alignment_stiffness_last * (bends_y() ? kPartsLastStiffness : 1);
  const double fall = last / options_.alignment_stiffness_first;
  const int last_step = (options_.alignment_rounds - 1) / kRoundsPerStiffness;
  for (int round = begin; round < end;) {
    const int step = round / kRoundsPerStiffness;
    const int next = std::min(end, (step + 1) * kRoundsPerStiffness);
    const double part = last_step > 0 ? double(step) / last_step : 1;
    const double stiffness =
        options_.alignment_stiffness_first * std::pow(fall, part);
    ISOMATCH_RETURN_IF_ERROR(alignment->Run(stiffness, next - round, stop_));
    ISOMATCH_RETURN_IF_ERROR(Mask(round, stiffness, alignment));
    round = next;
    progress(double(round - begin) / (end - begin));
    if (hurries()) return round;
  }
  return end;
}

/// Squared difference between the descriptors of two vertices, where both have
/// one.
std::optional<double> CandidateChoice::Difference(VertexIndex x,
                                                  VertexIndex y) const {
  if (!described()) return std::nullopt;
  const int of_x = descriptors_[kX]->column_of_vertex[x];
  const int of_y = descriptors_[kY]->column_of_vertex[y];
  if (of_x < 0 || of_y < 0) return std::nullopt;
  return (descriptors_[kX]->columns.col(of_x) -
          descriptors_[kY]->columns.col(of_y))
      .squaredNorm();
}

double CandidateChoice::LookedUpMismatch(
    const VertexMap& y_from_x, const std::vector<char>& matched) const {
  double mismatch = 0;
  double area = 0;
  for (VertexIndex x = 0; x < x_.mesh.num_vertices(); ++x) {
    if (!matched.empty() && !matched[x]) continue;
    if (const auto difference = Difference(x, y_from_x[x])) {
      mismatch += x_.laplacian.mass[x] * *difference;
      area += x_.laplacian.mass[x];
    }
  }
  return area > 0 ? mismatch / area : 0;
}

FirstSigns CandidateChoice::SignsOf(const ElasticAlignment& alignment,
                                    const Candidate& candidate) const {
  const AlignmentScore score = alignment.Score();
  double moved = 0;
  for (VertexIndex x = 0; x < x_.mesh.num_vertices(); ++x) {
    moved +=
        x_.laplacian.mass[x] * (y_.mesh.positions.row(alignment.y_from_x()[x]) -
                                y_.mesh.positions.row(candidate.filtered[x]))
                                   .norm();
  }
  return {score.stretch, score.normal_mismatch,
          moved / x_.laplacian.mass.sum()};
}

absl::Status CandidateChoice::Judge(const ElasticAlignment& alignment,
                                    Candidate* candidate) const {
  candidate->y_from_x = alignment.y_from_x();
  candidate->matched = alignment.matched();
  MapScores* const scores = &candidate->scores;
  const AlignmentScore score = alignment.Score();
  scores->stretch = score.stretch;
  if (masks()) {
    scores->normal_mismatch = score.normal_mismatch;
    return JudgeOverlap(alignment, scores);
  }
  if (oriented_) scores->normal_mismatch = score.normal_mismatch;
  if (described()) {
    ISOMATCH_ASSIGN_OR_RETURN(
        scores->descriptor_mismatch,
        DescriptorMismatch(*descriptors_[kX], surface_y_, alignment.y_from_x(),
                           ball_, stop_));
  }
  scores->rank_value = MisfitOf(*candidate, oriented_, options_);
  return absl::OkStatus();
}

absl::Status CandidateChoice::JudgeOverlap(const ElasticAlignment& alignment,
                                           MapScores* scores) const {
  scores->descriptor_mismatch =
      LookedUpMismatch(alignment.y_from_x(), alignment.matched());
  ISOMATCH_ASSIGN_OR_RETURN(const OverlapMisfit misfit,
                            rule_->Misfit(alignment));
  scores->rank_value *= std::max(misfit.distortion, kLeastDistortion) *
                        (1 + misfit.open_border / kDoublingBorder) *
                        std::sqrt(std::max(scores->stretch, kLeastStretch));
  return absl::OkStatus();
}

AlignmentOptions CandidateChoice::HowAligned() const {
  AlignmentOptions options;
  options.basis = options_.alignment_basis;
  options.bend_y = bends_y();
  if (is_mostly_rim_) options.spectral_weight = kRimSpectralWeight;
  if (!oriented_) options.normal_weight = 0;
  if (masks()) {
    // Eigenfunctions of parts differ.
    options.basis = 1;
    options.spectral_weight = 0;
  }
  return options;
}

absl::StatusOr<std::unique_ptr<ElasticAlignment>> CandidateChoice::LayOut(
    const Candidate& candidate) const {
  auto alignment = std::make_unique<ElasticAlignment>(x_, y_, HowAligned(),
                                                      candidate.y_from_x);
  if (masks()) {
    alignment->SetMatched(rule_->NearMatches(candidate.sparse));
  }
  if (is_part()) {
    ISOMATCH_RETURN_IF_ERROR(alignment->Settle(
        options_.alignment_stiffness_first, kFirstSteps, stop_));
  }
  return alignment;
}

absl::StatusOr<std::unique_ptr<ElasticAlignment>> CandidateChoice::Choose(
    const std::function<void(double)>& progress,
    std::vector<Candidate>* candidates) {
  if (hurries() && !masks()) {
    KeepOnly(Likeliest(*candidates), candidates);
    return nullptr;
  }
  ISOMATCH_RETURN_IF_ERROR(DescribeAlike());
  ISOMATCH_RETURN_IF_ERROR(Compare());
  if (rule_) ISOMATCH_RETURN_IF_ERROR(rule_->SolveSources());
  if (!bends_y()) faces_y_ = FacesAroundVertices(y_.mesh, y_.stars);
  ISOMATCH_ASSIGN_OR_RETURN(std::unique_ptr<ElasticAlignment> next,
                            Begin(&candidates->front()));
  Lead lead;
  std::size_t judged = 0;
  bool all_compare = true;
  while (judged < candidates->size() && next != nullptr) {
    if (hurries() && masks() && judged > 0) break;
    Candidate& candidate = (*candidates)[judged];
    const auto report = [&](double fraction) {
      progress((double(judged) + fraction) /
               static_cast<double>(candidates->size()));
    };
    // Factors and the like keep one core busy: the next one is begun beside.
    std::unique_ptr<ElasticAlignment> alignment = std::exchange(next, nullptr);
    bool compares = true;
    ISOMATCH_RETURN_IF_ERROR(RunBoth(
        [&]() -> absl::Status {
          ISOMATCH_ASSIGN_OR_RETURN(
              compares,
              Follow(report, &candidate, std::move(alignment), &lead));
          return absl::OkStatus();
        },
        [&]() -> absl::Status {
          ISOMATCH_ASSIGN_OR_RETURN(next, BeginAt(judged + 1, candidates));
          return absl::OkStatus();
        }));
    if (!compares && masks()) break;
    all_compare = all_compare && compares;
    ++judged;
  }
  if (judged > 0 && judged < candidates->size()) {
    const std::size_t likeliest = Likeliest(*candidates);
    if (likeliest >= judged) {
      KeepOnly(likeliest, candidates);
      return nullptr;
    }
  }
  KeepFirst(std::max<std::size_t>(judged, 1), candidates);
  std::stable_sort(candidates->begin(), candidates->end(), RanksBefore);
  RankLost(candidates);
  if (!all_compare) KeepFirst(1, candidates);
  return std::move(lead.alignment);
}

/// In a hurry: the position of the map that sends vertices to those that look
/// most alike.
std::size_t CandidateChoice::Likeliest(
    const std::vector<Candidate>& candidates) const {
  if (is_part()) return 0;
  std::vector<double> mismatches;
  mismatches.reserve(candidates.size());
  for (const Candidate& candidate : candidates) {
    mismatches.push_back(LookedUpMismatch(candidate.y_from_x, {}));
  }
  return std::ranges::min_element(mismatches) - mismatches.begin();
}

/// Judges a map that was begun, or gives it up. In a hurry it is judged as it
/// is, but of overlaps not against others: with fewer rounds than the leading
/// one it is more likely to lose. False where it had fewer.
absl::StatusOr<bool> CandidateChoice::Follow(
    const std::function<void(double)>& progress, Candidate* candidate,
    std::unique_ptr<ElasticAlignment> alignment, Lead* lead) const {
  candidate->is_lost =
      lead->candidate != nullptr && IsLost(*candidate, *lead->candidate);
  if (candidate->is_lost) {
    JudgeLost(candidate);
    return true;
  }
  const int rounds = std::min(kJudgedRounds, options_.alignment_rounds);
  const bool is_rival = lead->candidate != nullptr;
  int done = std::min(kFirstRounds, rounds);
  if (!is_rival || !hurries()) {
    ISOMATCH_ASSIGN_OR_RETURN(
        done, RunRounds(done, rounds, progress, alignment.get()));
  }
  if (masks() && is_rival && done < rounds) return false;
  ISOMATCH_RETURN_IF_ERROR(Judge(*alignment, candidate));
  if (!is_rival || RanksBefore(*candidate, *lead->candidate)) {
    *lead = {candidate, std::move(alignment)};
  }
  return done == rounds;
}

/// nullptr where there is no other one, or no time for it.
absl::StatusOr<std::unique_ptr<ElasticAlignment>> CandidateChoice::BeginAt(
    std::size_t next, std::vector<Candidate>* candidates) const {
  if (next == candidates->size() || hurries()) return nullptr;
  return Begin(&(*candidates)[next]);
}

/// Refines a dense map and lays it out by the first rounds.
absl::StatusOr<std::unique_ptr<ElasticAlignment>> CandidateChoice::Begin(
    Candidate* candidate) const {
  if (!is_part()) {
    candidate->dense_mismatch = LookedUpMismatch(candidate->y_from_x, {});
  }
  ISOMATCH_RETURN_IF_ERROR(Filter(&candidate->y_from_x));
  candidate->filtered = candidate->y_from_x;
  ISOMATCH_ASSIGN_OR_RETURN(std::unique_ptr<ElasticAlignment> alignment,
                            LayOut(*candidate));
  const int rounds = std::min(kFirstRounds, options_.alignment_rounds);
  ISOMATCH_RETURN_IF_ERROR(RunRounds(
                               0, rounds, [](double) {}, alignment.get())
                               .status());
  candidate->y_from_x = alignment->y_from_x();
  if (!masks()) candidate->first_signs = SignsOf(*alignment, *candidate);
  return alignment;
}

/// What is known of a map that is given up.
void CandidateChoice::JudgeLost(Candidate* candidate) const {
  candidate->scores.stretch = candidate->first_signs.stretch;
  candidate->scores.normal_mismatch = candidate->first_signs.normals;
  candidate->scores.descriptor_mismatch =
      LookedUpMismatch(candidate->y_from_x, {});
}

/// A map that sends nearly all elsewhere, as a mirror image or a half turn of
/// the leading one does, is a rival to the end.
bool CandidateChoice::IsLost(const Candidate& candidate,
                             const Candidate& leading) const {
  return !masks() && oriented_ &&
         IsFarBehind(candidate.first_signs, leading.first_signs) &&
         ShareInPlace(basis_y_, candidate.y_from_x, leading.y_from_x) >
             kPartlyOne;
}

absl::StatusOr<int> CandidateChoice::Finish(
    bool from_start, const std::function<void(double)>& progress,
    ElasticAlignment* alignment) const {
  const int begin =
      from_start ? 0 : std::min(kJudgedRounds, options_.alignment_rounds - 1);
  return RunRounds(begin, options_.alignment_rounds, progress, alignment);
}

absl::StatusOr<std::vector<float>> CandidateChoice::DescriptorOffsets(
    const VertexMap& y_from_x) {
  std::vector<float> offsets(y_from_x.size(), -1);
  if (!described()) return offsets;
  // What was in a hurry has not compared them yet.
  ISOMATCH_RETURN_IF_ERROR(Compare());
  ISOMATCH_ASSIGN_OR_RETURN(
      const VertexMap alike,
      MatchNearby(*compared_, y_from_x,
                  {.reach = kOffsetReach, .every = kOffsetEvery}, stop_));
  for (std::size_t x = 0; x < alike.size(); ++x) {
    if (alike[x] == kNoVertex) continue;
    offsets[x] = static_cast<float>(
        (y_.mesh.positions.row(alike[x]) - y_.mesh.positions.row(y_from_x[x]))
            .norm());
  }
  return offsets;
}

}  // namespace isomatch
