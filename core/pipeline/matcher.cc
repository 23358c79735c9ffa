#include "core/pipeline/matcher.h"

#include <algorithm>
#include <array>
#include <memory>
#include <optional>
#include <utility>

#include "absl/strings/str_cat.h"
#include "core/base/parallel.h"
#include "core/base/status_macros.h"
#include "core/matching/matching.h"
#include "core/pipeline/component_matching.h"
#include "core/pipeline/instruction_set.h"
#include "core/pipeline/match_run.h"
#include "core/pipeline/matcher_functions.h"
#include "core/pipeline/memory_plan.h"
#include "core/pipeline/preparation.h"
#include "core/pipeline/progress_reporter.h"
#include "core/pipeline/shape_contents.h"
#include "core/pipeline/stage_plan.h"

namespace isomatch {
namespace {

absl::StatusOr<Correspondence> MatchClean(CleanMesh mesh_x, CleanMesh mesh_y,
                                          absl::Span<const Landmark> landmarks,
                                          const MatchOptions& options,
                                          const ProgressCallback& progress,
                                          const std::stop_token& stop) {
  ProgressReporter reporter(progress, StagePlan(options));
  std::array<PreparedMesh, 2> prepared;
  ISOMATCH_RETURN_IF_ERROR(PrepareMeshes({std::move(mesh_x), std::move(mesh_y)},
                                         options, &reporter, stop, &prepared));
  return RunMatch(prepared[kX], &prepared[kX], prepared[kY], landmarks, options,
                  &reporter, stop);
}

/// Part by part where there are several.
absl::StatusOr<Correspondence> MatchParts(const TriangleMesh& mesh_x,
                                          const TriangleMesh& mesh_y,
                                          absl::Span<const Landmark> landmarks,
                                          const MatchOptions& options,
                                          const ProgressCallback& progress,
                                          const std::stop_token& stop) {
  // Cleaning takes its time and comes before all reports.
  if (progress) progress({Stage::kPrepare, 0, 0});
  std::array<MeshParts, 2> parts;
  const auto split = [&](const TriangleMesh& mesh,
                         MeshParts* into) -> absl::Status {
    ISOMATCH_ASSIGN_OR_RETURN(*into, SplitIntoParts(mesh, stop));
    return absl::OkStatus();
  };
  ISOMATCH_RETURN_IF_ERROR(RunBoth([&] { return split(mesh_x, &parts[kX]); },
                                   [&] { return split(mesh_y, &parts[kY]); }));
  if (options.match_components && MatchedByParts(parts[kX], parts[kY])) {
    const auto match_one =
        [&](const TriangleMesh& x, const TriangleMesh& y,
            absl::Span<const Landmark> known,
            const ProgressCallback& report) -> absl::StatusOr<Correspondence> {
      ISOMATCH_ASSIGN_OR_RETURN(CleanMesh clean_x, Clean(x, stop));
      ISOMATCH_ASSIGN_OR_RETURN(CleanMesh clean_y, Clean(y, stop));
      return MatchClean(std::move(clean_x), std::move(clean_y), known, options,
                        report, stop);
    };
    return MatchByParts(mesh_x, parts[kX], parts[kY], landmarks, match_one,
                        progress, stop);
  }
  return MatchClean(std::move(parts[kX].clean), std::move(parts[kY].clean),
                    landmarks, options, progress, stop);
}

using ShapeContents = std::shared_ptr<PreparedShape::Contents>;

ShapeContents NewContents(TriangleMesh mesh, const MatchOptions& options) {
  auto contents = std::make_shared<PreparedShape::Contents>();
  contents->mesh = std::move(mesh);
  contents->key = PreparationKey::Of(options);
  return contents;
}

/// Fills in one or both; the second may be null.
absl::Status PrepareContents(const std::array<ShapeContents, 2>& shapes,
                             const MatchOptions& options,
                             const ProgressCallback& progress,
                             const std::stop_token& stop) {
  std::array<std::optional<CleanMesh>, 2> clean;
  const auto split = [&](int i) -> absl::Status {
    if (shapes[i] == nullptr) return absl::OkStatus();
    ISOMATCH_ASSIGN_OR_RETURN(MeshParts parts,
                              SplitIntoParts(shapes[i]->mesh, stop));
    shapes[i]->large_components = static_cast<std::int32_t>(parts.large.size());
    clean[i] = std::move(parts.clean);
    return absl::OkStatus();
  };
  absl::Status status = absl::InternalError("not run");
  RunWithThreads(options.threads, [&] {
    ProgressReporter reporter(progress, StagePlan(options));
    std::array<PreparedMesh, 2> prepared;
    status = RunBoth([&] { return split(kX); }, [&] { return split(kY); });
    if (status.ok()) {
      status =
          PrepareMeshes(std::move(clean), options, &reporter, stop, &prepared);
    }
    for (const int i : {kX, kY}) {
      if (shapes[i] != nullptr) shapes[i]->prepared = std::move(prepared[i]);
    }
  });
  return status;
}

/// The last word on a whole map, whatever parts it was found in.
void Judge(Correspondence* found) {
  double sum = 0;
  std::int64_t matched = 0;
  for (std::size_t x = 0; x < found->confidence.size(); ++x) {
    if (found->y_from_x[x] == kNoVertex) continue;
    sum += found->confidence[x];
    ++matched;
  }
  found->quality.mean_confidence =
      matched == 0 ? 0 : sum / static_cast<double>(matched);
  found->verdict = VerdictOf(*found);
}

template <typename T>
absl::Status CheckSame(const std::string& field, const char* option, T found,
                       T expected) {
  if (found == expected) return absl::OkStatus();
  return absl::InvalidArgumentError(
      absl::StrCat(field, ": prepared with ", option, " ", found,
                   ", expected the job's own, ", expected));
}

/// Names the option that differs.
absl::Status CheckSameKey(const std::string& field, const PreparationKey& found,
                          const PreparationKey& expected) {
  ISOMATCH_RETURN_IF_ERROR(CheckSame(field, "solved_vertices",
                                     found.solved_vertices,
                                     expected.solved_vertices));
  ISOMATCH_RETURN_IF_ERROR(
      CheckSame(field, "pool_size", found.pool_size, expected.pool_size));
  ISOMATCH_RETURN_IF_ERROR(CheckSame(field, "spectral basis size",
                                     found.eigenpairs, expected.eigenpairs));
  ISOMATCH_RETURN_IF_ERROR(CheckSame(field, "curvature_radius",
                                     found.curvature_radius,
                                     expected.curvature_radius));
  return CheckSame(field, "descriptor_radius", found.descriptor_radius,
                   expected.descriptor_radius);
}

}  // namespace

PreparationKey PreparationKey::Of(const MatchOptions& options) {
  PreparationKey key;
  key.solved_vertices = options.solved_vertices;
  key.pool_size = options.pool_size;
  key.eigenpairs = SpectralCount(options);
  if (options.curvature_weight > 0) {
    key.curvature_radius = options.curvature_radius;
  }
  if (options.alignment_rounds > 0) {
    key.descriptor_radius = options.descriptor_radius;
  }
  return key;
}

absl::Status ValidateLandmarks(absl::Span<const Landmark> landmarks,
                               std::int64_t vertices_x,
                               std::int64_t vertices_y) {
  std::unordered_map<VertexIndex, std::size_t> first_x;
  std::unordered_map<VertexIndex, std::size_t> first_y;
  const auto check = [](std::size_t i, const char* field, VertexIndex vertex,
                        std::int64_t vertices,
                        std::unordered_map<VertexIndex, std::size_t>* first) {
    if (vertex < 0 || vertex >= vertices) {
      return absl::InvalidArgumentError(
          absl::StrCat("landmarks[", i, "].", field, ": ", vertex,
                       ", expected 0 to ", vertices - 1));
    }
    const auto [it, is_new] = first->try_emplace(vertex, i);
    if (is_new) return absl::OkStatus();
    return absl::InvalidArgumentError(
        absl::StrCat("landmarks[", i, "].", field, ": vertex ", vertex,
                     " is already matched by landmarks[", it->second,
                     "], expected each vertex at most once"));
  };
  for (std::size_t i = 0; i < landmarks.size(); ++i) {
    ISOMATCH_RETURN_IF_ERROR(
        check(i, "x", landmarks[i].x, vertices_x, &first_x));
    ISOMATCH_RETURN_IF_ERROR(
        check(i, "y", landmarks[i].y, vertices_y, &first_y));
  }
  return absl::OkStatus();
}

absl::StatusOr<Correspondence> MatchHere(const TriangleMesh& mesh_x,
                                         const TriangleMesh& mesh_y,
                                         absl::Span<const Landmark> landmarks,
                                         const MatchOptions& options,
                                         const ProgressCallback& progress,
                                         std::stop_token stop) {
  ISOMATCH_RETURN_IF_ERROR(options.Validate());
  ISOMATCH_RETURN_IF_ERROR(ValidateMesh(mesh_x, "mesh_x"));
  ISOMATCH_RETURN_IF_ERROR(ValidateMesh(mesh_y, "mesh_y"));
  ISOMATCH_RETURN_IF_ERROR(ValidateLandmarks(landmarks, mesh_x.num_vertices(),
                                             mesh_y.num_vertices()));
  ISOMATCH_ASSIGN_OR_RETURN(
      const MemoryPlan plan,
      PlanWithinMemory(SizeOf(mesh_x), SizeOf(mesh_y),
                       static_cast<std::int64_t>(landmarks.size()), options));
  absl::StatusOr<Correspondence> result = absl::InternalError("not run");
  RunWithThreads(plan.options.threads, [&] {
    result =
        MatchParts(mesh_x, mesh_y, landmarks, plan.options, progress, stop);
  });
  if (result.ok()) {
    Judge(&*result);
    result->warnings.insert(result->warnings.begin(), plan.warnings.begin(),
                            plan.warnings.end());
  }
  return result;
}

absl::StatusOr<PreparedShape> PrepareHere(TriangleMesh mesh,
                                          const MatchOptions& options,
                                          const ProgressCallback& progress,
                                          std::stop_token stop) {
  ISOMATCH_RETURN_IF_ERROR(options.Validate());
  ISOMATCH_RETURN_IF_ERROR(ValidateMesh(mesh, "mesh"));
  const ShapeContents shape = NewContents(std::move(mesh), options);
  ISOMATCH_RETURN_IF_ERROR(
      PrepareContents({shape, nullptr}, options, progress, stop));
  return PreparedShape(shape);
}

absl::StatusOr<PreparedPair> PrepareBothHere(TriangleMesh mesh_x,
                                             TriangleMesh mesh_y,
                                             const MatchOptions& options,
                                             const ProgressCallback& progress,
                                             std::stop_token stop) {
  ISOMATCH_RETURN_IF_ERROR(options.Validate());
  ISOMATCH_RETURN_IF_ERROR(ValidateMesh(mesh_x, "mesh_x"));
  ISOMATCH_RETURN_IF_ERROR(ValidateMesh(mesh_y, "mesh_y"));
  const ShapeContents x = NewContents(std::move(mesh_x), options);
  const ShapeContents y = NewContents(std::move(mesh_y), options);
  ISOMATCH_RETURN_IF_ERROR(PrepareContents({x, y}, options, progress, stop));
  return PreparedPair{PreparedShape(x), PreparedShape(y)};
}

std::string PreparationText(const MatchOptions& options) {
  const PreparationKey key = PreparationKey::Of(options);
  return absl::StrCat(InstructionSet(), " ", key.solved_vertices, " ",
                      key.pool_size, " ", key.eigenpairs, " ",
                      key.curvature_radius, " ", key.descriptor_radius);
}

std::int64_t PreparedShapeBytes(const PreparedShape& shape) {
  // Of each vertex, and of each face beyond two a vertex: mesh, clean mesh,
  // stars, numberings and, where decimated, embedding; measured, with a third
  // to spare.
  constexpr std::int64_t kVertex = 900;
  constexpr std::int64_t kFace = 150;
  const PreparedShape::Contents& contents = shape.contents();
  const PreparedMesh& prepared = contents.prepared;
  const auto bytes = [](std::int64_t count, size_t size) {
    return count * static_cast<std::int64_t>(size);
  };
  return kVertex * (contents.mesh.num_vertices() +
                    prepared.solved().mesh.num_vertices()) +
         kFace *
             std::max<std::int64_t>(0, contents.mesh.num_faces() -
                                           2 * contents.mesh.num_vertices()) +
         bytes(static_cast<std::int64_t>(prepared.hash.basis.fields().size()),
               sizeof(float)) +
         bytes(prepared.spectral.functions.size(), sizeof(double)) +
         bytes(prepared.descriptors.columns.size(), sizeof(float));
}

absl::StatusOr<Correspondence> MatchPreparedHere(
    const PreparedShape& x, const PreparedShape& y,
    absl::Span<const Landmark> landmarks, const MatchOptions& options,
    const ProgressCallback& progress, std::stop_token stop) {
  ISOMATCH_RETURN_IF_ERROR(options.Validate());
  const PreparedShape::Contents& own_x = x.contents();
  const PreparedShape::Contents& own_y = y.contents();
  const PreparationKey key = PreparationKey::Of(options);
  ISOMATCH_RETURN_IF_ERROR(CheckSameKey("mesh_x", own_x.key, key));
  ISOMATCH_RETURN_IF_ERROR(CheckSameKey("mesh_y", own_y.key, key));
  if (options.match_components &&
      (own_x.large_components > 1 || own_y.large_components > 1)) {
    return MatchHere(own_x.mesh, own_y.mesh, landmarks, options, progress,
                     stop);
  }
  ISOMATCH_RETURN_IF_ERROR(ValidateLandmarks(
      landmarks, own_x.mesh.num_vertices(), own_y.mesh.num_vertices()));
  ISOMATCH_RETURN_IF_ERROR(CheckDecimated(SizesOf(own_x.prepared),
                                          SizesOf(own_y.prepared), options));
  absl::StatusOr<Correspondence> result = absl::InternalError("not run");
  RunWithThreads(options.threads, [&] {
    ProgressReporter reporter(progress, StagePlan(options));
    // Nothing is left to prepare; the stages are reported all the same.
    const absl::Status prepared =
        PrepareMeshes({}, options, &reporter, stop, nullptr);
    result = !prepared.ok() ? absl::StatusOr<Correspondence>(prepared)
                            : RunMatch(own_x.prepared, nullptr, own_y.prepared,
                                       landmarks, options, &reporter, stop);
  });
  if (result.ok()) Judge(&*result);
  return result;
}

}  // namespace isomatch

const isomatch::MatcherFunctions* ISOMATCH_MATCHER_FUNCTIONS() {
  static constexpr isomatch::MatcherFunctions kFunctions = {
      isomatch::MatchHere, isomatch::PrepareHere, isomatch::PrepareBothHere,
      isomatch::MatchPreparedHere, isomatch::ParsePreparedShapeHere};
  return &kFunctions;
}
