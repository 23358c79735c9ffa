// Compiled, as instruction_set.cc, for the oldest processors alone: which
// functions to call is found out here, and nothing newer may run before that.
#include "core/pipeline/matcher.h"

#include <string>
#include <unordered_map>
#include <utility>
#include <variant>

#include "absl/strings/str_cat.h"
#include "core/base/parallel.h"
#include "core/base/status_macros.h"
#include "core/pipeline/instruction_set.h"
#include "core/pipeline/joined_progress.h"
#include "core/pipeline/memory_plan.h"
#include "core/pipeline/shape_contents.h"
#include "core/pipeline/shape_matching.h"

#ifdef ISOMATCH_DISPATCH
extern "C" const isomatch::MatchEngine* isomatch_match_engine_x86_64_v3();
#endif

namespace isomatch {
namespace {

const MatchEngine& ChosenEngine() {
#ifdef ISOMATCH_DISPATCH
  if (InstructionSet() != ISOMATCH_BASELINE) {
    return *isomatch_match_engine_x86_64_v3();
  }
#endif
  return *ISOMATCH_MATCH_ENGINE();
}

/// ValidateMesh of both, null for one that is prepared.
absl::Status ValidateBoth(const TriangleMesh* x, const TriangleMesh* y,
                          const MatchOptions& options) {
  const auto validate = [](const TriangleMesh* mesh, const char* field) {
    return mesh == nullptr ? absl::OkStatus() : ValidateMesh(*mesh, field);
  };
  absl::Status valid;
  RunWithThreads(options.threads, [&] {
    valid = RunBoth([&] { return validate(x, "mesh_x"); },
                    [&] { return validate(y, "mesh_y"); });
  });
  return valid;
}

const TriangleMesh* MeshOf(const ShapeSource& source) {
  const auto* mesh = std::get_if<SharedMesh>(&source);
  return mesh == nullptr ? nullptr : &**mesh;
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

MatchEngine CoreMatchEngine() {
  return {.prepare = Prepare,
          .prepare_both = PrepareBoth,
          .match = MatchPrepared,
          .parse = ParsePreparedShape,
          .estimate = EstimateMemoryBytes};
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

absl::StatusOr<Correspondence> Match(const TriangleMesh& mesh_x,
                                     const TriangleMesh& mesh_y,
                                     absl::Span<const Landmark> landmarks,
                                     const MatchOptions& options,
                                     const MatchControl& control) {
  ISOMATCH_RETURN_IF_ERROR(options.Validate());
  ISOMATCH_RETURN_IF_ERROR(ValidateBoth(&mesh_x, &mesh_y, options));
  ISOMATCH_RETURN_IF_ERROR(ValidateLandmarks(landmarks, mesh_x.num_vertices(),
                                             mesh_y.num_vertices()));
  ISOMATCH_ASSIGN_OR_RETURN(
      const MemoryPlan plan,
      PlanWithinMemory(SizeOf(mesh_x), SizeOf(mesh_y),
                       static_cast<std::int64_t>(landmarks.size()), options));
  const MatchEngine& engine = ChosenEngine();
  JoinedProgress joined(control.progress);
  ISOMATCH_ASSIGN_OR_RETURN(
      PreparedPair pair,
      engine.prepare_both(SharedMesh::Borrowed(mesh_x),
                          SharedMesh::Borrowed(mesh_y), plan.options,
                          control.With(joined.OfPreparation())));
  absl::StatusOr<Correspondence> found =
      engine.match(std::move(pair.x), std::move(pair.y), landmarks,
                   plan.options, control.With(joined.OfMatching()));
  if (found.ok()) {
    found->warnings.insert(found->warnings.begin(), plan.warnings.begin(),
                           plan.warnings.end());
  }
  return found;
}

absl::StatusOr<PreparedShape> Prepare(SharedMesh mesh,
                                      const MatchOptions& options,
                                      const MatchControl& control) {
  ISOMATCH_RETURN_IF_ERROR(options.Validate());
  ISOMATCH_RETURN_IF_ERROR(ValidateMesh(*mesh, "mesh"));
  return ChosenEngine().prepare(std::move(mesh), options, control);
}

absl::StatusOr<PreparedPair> PrepareBoth(ShapeSource x, ShapeSource y,
                                         const MatchOptions& options,
                                         const MatchControl& control) {
  ISOMATCH_RETURN_IF_ERROR(options.Validate());
  ISOMATCH_RETURN_IF_ERROR(ValidateBoth(MeshOf(x), MeshOf(y), options));
  return ChosenEngine().prepare_both(std::move(x), std::move(y), options,
                                     control);
}

absl::StatusOr<Correspondence> MatchPrepared(
    PreparedShape x, PreparedShape y, absl::Span<const Landmark> landmarks,
    const MatchOptions& options, const MatchControl& control) {
  ISOMATCH_RETURN_IF_ERROR(options.Validate());
  const PreparationKey key = PreparationKey::Of(options);
  ISOMATCH_RETURN_IF_ERROR(CheckSameKey("mesh_x", x.contents().key, key));
  ISOMATCH_RETURN_IF_ERROR(CheckSameKey("mesh_y", y.contents().key, key));
  ISOMATCH_RETURN_IF_ERROR(
      ValidateLandmarks(landmarks, x.contents().mesh->num_vertices(),
                        y.contents().mesh->num_vertices()));
  return ChosenEngine().match(std::move(x), std::move(y), landmarks, options,
                              control);
}

absl::StatusOr<PreparedShape> ParsePreparedShape(absl::string_view bytes,
                                                 std::stop_token stop) {
  return ChosenEngine().parse(bytes, std::move(stop));
}

}  // namespace isomatch
