#include <algorithm>
#include <cmath>
#include <cstdint>
#include <initializer_list>
#include <thread>
#include <utility>

#include "core/descriptor/nearby_match.h"
#include "core/descriptor/shot_descriptor.h"
#include "core/geodesic/basis_points.h"
#include "core/geodesic/field_sweeps.h"
#include "core/matching/closeness.h"
#include "core/mesh/surface_samples.h"
#include "core/pipeline/part_start.h"
#include "core/pipeline/prepared_mesh.h"
#include "core/pipeline/stage_plan.h"
#include "core/spectral/filtered_subspace.h"
#include "core/spectral/spectral_basis.h"

namespace isomatch {
namespace {

// Bytes, as doubles: products of hostile sizes must not wrap.

/// Code pages, allocator slack and thread stacks that appear with a first run.
constexpr double kFixed = 12e6;
/// NearestColumns of one thread, and of it by dimension.
constexpr double kSearchPerThread = 0.5e6;
constexpr double kSearchPerRow = 2048;
/// A ConnectedBall, and what a large one holds.
constexpr double kBallPerVertex = 40;
/// A distance field workspace: distances, touched vertices, buckets.
constexpr double kWorkspacePerVertex = 80;
/// What lies free between the arrays of a part's many maps, in huge pages that
/// the heap keeps.
constexpr double kBetweenMaps = 8e6;

/// What one shape takes, by what holds it.
struct ShapeBytes {
  double working;        ///< clean mesh, normals, maps: kept to the end
  double stencils;       ///< and tables, while distance fields are computed
  double fields;         ///< kept to the end
  double eigenpairs;     ///< while eigenpairs are computed, both sides at once
  double functions;      ///< eigenfunctions, kept to the end
  double pool;           ///< closeness table and frames of the first stage
  double dense_columns;  ///< closeness of every vertex to the sparse matches
  double columns;        ///< single-precision bases, and one carried over
  double descriptors;    ///< from the choice to the end
  double features;       ///< of the alignment
  double surface;        ///< its factor, rotations, normals, of X alone
};

int FirstStageMatches(std::int64_t num_landmarks, const MatchOptions& options) {
  constexpr std::int64_t kMostLandmarks = 1000;
  return static_cast<int>(std::max<std::int64_t>(
      options.first_stage_matches, std::min(num_landmarks, kMostLandmarks)));
}

double PoolSize(MeshSize mesh, std::int64_t num_landmarks,
                const MatchOptions& options) {
  const double n = static_cast<double>(mesh.vertices);
  if (options.pool_size == 0) return n;
  return std::min(n, options.pool_size + double(num_landmarks));
}

double EigenpairBytes(double n, double m, double count) {
  // Krylov vectors, and those of them that a restart keeps, rotated.
  const double subspace = LanczosSubspace(static_cast<int>(count));
  const double krylov = 8 * n * (subspace + 0.5 * (subspace + count));
  // Or three blocks in single precision, the pairs, and matrices of a block.
  constexpr double kSmall = 9;
  const auto size = static_cast<double>(SubspaceSize(static_cast<int>(count)));
  const double blocks =
      12 * n * size + 8 * n * count + kSmall * 8 * size * size;
  const double vectors = std::max(krylov, blocks);
  // Triplets, stiffness in three forms, the factor: nested growth of about
  // 3 log2(n) entries a row on surfaces.
  const double matrices =
      192 * m + 300 * n + 12 * n * 3 * std::log2(std::max(n, 2.0));
  return IsSolvedDensely(n, static_cast<int>(count)) ? 40 * n * n
                                                     : vectors + matrices;
}

ShapeBytes BytesOf(MeshSize mesh, std::int64_t num_landmarks,
                   const MatchOptions& options) {
  const double n = static_cast<double>(mesh.vertices);
  const double m = static_cast<double>(mesh.faces);
  const double basis = BasisPoints::DefaultCount(
      static_cast<VertexIndex>(std::min<std::int64_t>(mesh.vertices, 1 << 30)));
  const double pool = PoolSize(mesh, num_landmarks, options);
  const double count = std::min<double>(SpectralCount(options), n);
  const bool tabulated = pool <= PointPool::kMaxTabulated;
  ShapeBytes bytes;
  bytes.working = 280 * n + 150 * m;
  bytes.stencils = (n <= FieldSweeps::kMostVertices ? 720 : 420) * n + 450 * m;
  bytes.fields = 4 * n * basis;
  bytes.eigenpairs = count > 0 ? EigenpairBytes(n, m, count) : 0;
  bytes.functions = 8 * n * count;
  bytes.pool =
      (tabulated ? 4 * pool * (pool + PointPool::kNearest) : 0) + 120 * pool;
  bytes.dense_columns = options.dense_from_closeness
                            ? 4 * (n + std::min(n, double(kSurfaceSamples))) *
                                  FirstStageMatches(num_landmarks, options)
                            : 0;
  bytes.columns = 2 * 4 * n * count;
  bytes.descriptors = options.alignment_rounds > 0
                          ? 4 * (kShotSize + kMainDirections + 1) *
                                    std::min(n, double(kDescribedVertices)) +
                                4 * n
                          : 0;
  // Three alignments at once: the best yet, the one under judgment and the
  // next, begun beside. They share what is known of Y's faces.
  const double alignments = options.alignment_rounds > 0 ? 3 : 0;
  constexpr double kFacesPerVertex = 750;
  bytes.features = alignments * 4 * n * (count + 6);
  bytes.surface = alignments * (400 * n + 40 * m +
                                12 * n * 3 * std::log2(std::max(n, 2.0))) +
                  (options.alignment_rounds > 0 ? kFacesPerVertex * n : 0);
  return bytes;
}

/// What the growing maps of the first stage take, one for each thread.
double MatchingBytes(MeshSize x, MeshSize y, std::int64_t num_landmarks,
                     const MatchOptions& options, double threads) {
  const double matches = FirstStageMatches(num_landmarks, options);
  double each = 8 * matches * matches + 400 * matches +
                8 * matches * std::min<double>(options.swap_neighbors, matches);
  for (const MeshSize mesh : {x, y}) {
    const double pool = PoolSize(mesh, num_landmarks, options);
    each += 32 * pool;
    if (pool > PointPool::kMaxTabulated) each += 4 * pool * matches;
  }
  // The best map is restored beside them.
  return each * (threads + 1);
}

/// What is solved on in place of `mesh`.
MeshSize SolvedSize(MeshSize mesh, const MatchOptions& options) {
  if (!IsDecimated(mesh.vertices, options)) return mesh;
  // Decimation may leave some more.
  const auto vertices =
      static_cast<std::int64_t>(1.03 * options.solved_vertices);
  return {vertices, 2 * vertices};
}

/// What a decimated mesh takes beside the one solved on: at first while it is
/// cleaned and decimated, then to the end, with what lies where on the other
/// shape.
struct FullBytes {
  double at_first = 0;
  double later = 0;
};

FullBytes FullBytesOf(MeshSize mesh, const MatchOptions& options) {
  if (!IsDecimated(mesh.vertices, options)) return {};
  const double n = static_cast<double>(mesh.vertices);
  const double m = static_cast<double>(mesh.faces);
  return {120 * n + 75 * m, 160 * n + 60 * m};
}

double Threads(const MatchOptions& options) {
  return options.threads > 0
             ? options.threads
             : std::max(1u, std::thread::hardware_concurrency());
}

/// What FindPartStart takes beside pools and growing maps: distances, twice as
/// nearness and once by size, descriptors of both radii, differences. Before
/// that distance fields, of every vertex to the pool.
struct PartStartBytes {
  double fields = 0;
  double search = 0;
};

PartStartBytes PartStartBytesOf(MeshSize x, MeshSize y,
                                std::int64_t num_landmarks,
                                const MatchOptions& options) {
  constexpr double kRadii = 2;
  constexpr double kTriples = 2e6;
  PartStartBytes bytes;
  bytes.search = kTriples;
  double differences = 1;
  for (const bool is_part : {true, false}) {
    const MeshSize mesh = is_part ? x : y;
    double pool = PoolSize(mesh, num_landmarks, options);
    if (is_part) pool = std::min(pool, kPartPoolSize + double(num_landmarks));
    bytes.fields += 4 * double(mesh.vertices) * pool + 4 * pool * pool;
    bytes.search += 20 * pool * pool + kRadii * 4 * kShotSize * pool;
    differences *= pool;
  }
  bytes.search += 12 * differences;
  return bytes;
}

/// A part is brought to the other's unit in a copy.
double CopiedBytes(const FullBytes& full, const ShapeBytes& solved) {
  return full.later + solved.working + solved.fields + solved.functions;
}

/// What CounterpartRule takes: distances to the rims, and between what is
/// matched. `n`: vertices of both shapes.
double RuleBytes(double stencils, double n, const MatchOptions& options) {
  if (options.relation == Relation::kWhole) return 0;
  constexpr double kMostSources = 80;
  return stencils + kWorkspacePerVertex * n * Threads(options) +
         4 * kMostSources * n;
}

/// The two best maps yet of what is looked for again, on all vertices.
double FoundBytes(MeshSize x, MeshSize y, const MatchOptions& options) {
  constexpr double kPerX = 160;
  constexpr double kPerY = 2;
  if (!options.IsTriedAgain()) return 0;
  return kPerX * static_cast<double>(x.vertices) +
         kPerY * static_cast<double>(y.vertices);
}

/// EstimateMemoryBytes of a relation that is known.
std::int64_t EstimateAsTold(MeshSize x, MeshSize y, std::int64_t num_landmarks,
                            const MatchOptions& options) {
  const double found = FoundBytes(x, y, options);
  // The part is laid on the whole.
  if (options.relation == Relation::kPartOfX) std::swap(x, y);
  const FullBytes full_x = FullBytesOf(x, options);
  const FullBytes full_y = FullBytesOf(y, options);
  x = SolvedSize(x, options);
  y = SolvedSize(y, options);
  const ShapeBytes bytes_x = BytesOf(x, num_landmarks, options);
  const ShapeBytes bytes_y = BytesOf(y, num_landmarks, options);
  const auto both = [&](double ShapeBytes::*member) {
    return bytes_x.*member + bytes_y.*member;
  };
  const double threads = Threads(options);
  const double n =
      static_cast<double>(x.vertices) + static_cast<double>(y.vertices);
  const double fields = both(&ShapeBytes::working) + both(&ShapeBytes::fields);
  const double search =
      threads * (kSearchPerThread +
                 kSearchPerRow * FirstStageMatches(num_landmarks, options));
  const bool is_part = options.relation != Relation::kWhole;
  // The finer of two unlike meshes is described anew, and parts are.
  const double described_anew =
      is_part ? both(&ShapeBytes::descriptors)
      : std::abs(double(x.vertices - y.vertices)) > 0.1 * n
          ? std::max(bytes_x.descriptors, bytes_y.descriptors)
          : 0;
  const double copied = is_part ? CopiedBytes(full_x, bytes_x) : 0;
  const double late = fields + both(&ShapeBytes::functions) + copied;
  const PartStartBytes part_start =
      is_part ? PartStartBytesOf(x, y, num_landmarks, options)
              : PartStartBytes();
  const double environments =
      options.candidates_from_environments || options.second_stage_fraction > 0
          ? 160 * n
          : 0;
  const double peak = std::max({
      // Geodesics; Spectral; Seeds and FirstInsertion; Dense; ZoomOut;
      // Choice and Alignment.
      fields + both(&ShapeBytes::stencils) + kWorkspacePerVertex * n * threads,
      fields + both(&ShapeBytes::eigenpairs),
      late + both(&ShapeBytes::pool) + environments +
          MatchingBytes(x, y, num_landmarks, options, threads) +
          part_start.search + kBallPerVertex * n * threads * double(is_part),
      late + part_start.fields + both(&ShapeBytes::stencils) * double(is_part),
      late + both(&ShapeBytes::dense_columns) + environments + search,
      late + both(&ShapeBytes::columns) + search,
      // Of columns those of both and the ones carried to Y.
      late + 0.75 * both(&ShapeBytes::columns) +
          both(&ShapeBytes::descriptors) + described_anew + search +
          kBallPerVertex * n * threads + both(&ShapeBytes::features) +
          bytes_x.surface + RuleBytes(both(&ShapeBytes::stencils), n, options),
  });
  constexpr double kLargest = 9e18;
  const double with_full = std::max(full_x.at_first + full_y.at_first,
                                    full_x.later + full_y.later + peak);
  return static_cast<std::int64_t>(std::min(
      with_full + kFixed + found + kBetweenMaps * double(is_part), kLargest));
}

/// The most that `estimate` says of the relations that are tried.
template <typename Estimate>
std::int64_t MostOfAll(const MatchOptions& options, const Estimate& estimate) {
  std::int64_t most = 0;
  for (const Relation relation : kRelations) {
    if (relation == Relation::kAuto) continue;
    MatchOptions tried = options;
    tried.relation = relation;
    most = std::max(most, estimate(tried));
  }
  return most;
}

}  // namespace

std::int64_t EstimatePreparedExtraBytes(MeshSize x, MeshSize y,
                                        const MatchOptions& options) {
  if (options.relation == Relation::kAuto) {
    return MostOfAll(options, [&](const MatchOptions& tried) {
      return EstimatePreparedExtraBytes(x, y, tried);
    });
  }
  if (options.relation == Relation::kPartOfX) std::swap(x, y);
  const ShapeBytes solved = BytesOf(SolvedSize(x, options), 0, options);
  constexpr double kLargest = 9e18;
  return static_cast<std::int64_t>(
      std::min(MeshBytes(x) + MeshBytes(y) +
                   CopiedBytes(FullBytesOf(x, options), solved),
               kLargest));
}

std::int64_t EstimateMemoryBytes(MeshSize x, MeshSize y,
                                 std::int64_t num_landmarks,
                                 const MatchOptions& options) {
  if (options.relation == Relation::kAuto) {
    return MostOfAll(options, [&](const MatchOptions& tried) {
      return EstimateMemoryBytes(x, y, num_landmarks, tried);
    });
  }
  return EstimateAsTold(x, y, num_landmarks, options);
}

}  // namespace isomatch
