#include "core/pipeline/preparation.h"

#include <functional>
#include <utility>

#include "absl/strings/str_cat.h"
#include "core/base/parallel.h"
#include "core/base/status_macros.h"
#include "core/matching/matching.h"
#include "core/pipeline/stage_plan.h"
#include "core/spectral/factor_size.h"
#include "core/spectral/mean_curvature.h"

namespace isomatch {
namespace {

absl::Status PrepareSpectral(const MatchOptions& options,
                             const std::stop_token& stop,
                             PreparedMesh* prepared) {
  const WorkingMesh& solved = prepared->solved();
  prepared->laplacian = BuildCotanLaplacian(solved.mesh);
  ISOMATCH_RETURN_IF_ERROR(CheckFactor(prepared->laplacian.stiffness));
  const int count = SpectralCount(options);
  if (count > 0) {
    ISOMATCH_ASSIGN_OR_RETURN(
        prepared->spectral,
        ComputeSpectralBasis(prepared->laplacian, count, stop));
  }
  prepared->curvature = Eigen::VectorXd::Zero(solved.mesh.num_vertices());
  if (options.curvature_weight > 0) {
    ISOMATCH_ASSIGN_OR_RETURN(
        prepared->curvature,
        SmoothedMeanCurvature(prepared->laplacian, solved.mesh.positions,
                              solved.normals, options.curvature_radius));
  }
  return absl::OkStatus();
}

/// `status`, which begins with the field that it is about if it is INVALID.
absl::Status About(const std::string& field, absl::Status status) {
  if (!absl::IsInvalidArgument(status)) return status;
  return absl::InvalidArgumentError(
      absl::StrCat(field, ": ", status.message()));
}

}  // namespace

absl::Status PrepareMeshes(std::array<std::optional<MeshToPrepare>, 2> meshes,
                           const MatchOptions& options,
                           ProgressReporter* progress,
                           const std::stop_token& stop,
                           std::array<PreparedMesh, 2>* prepared) {
  const auto both = [&](const std::function<absl::Status(Side)>& prepare) {
    const auto one = [&](Side side) {
      return meshes[side] ? prepare(side) : absl::OkStatus();
    };
    return RunBoth([&] { return one(kX); }, [&] { return one(kY); });
  };
  progress->Begin(Stage::kPrepare);
  ISOMATCH_RETURN_IF_ERROR(both([&](Side side) {
    return PrepareSurface(std::move(meshes[side]->clean), options, stop,
                          &(*prepared)[side]);
  }));
  ISOMATCH_RETURN_IF_ERROR(CheckDecimated(SizesOf((*prepared)[kX]),
                                          SizesOf((*prepared)[kY]), options));
  progress->Begin(Stage::kGeodesics);
  ISOMATCH_RETURN_IF_ERROR(both([&](Side side) -> absl::Status {
    ISOMATCH_ASSIGN_OR_RETURN(
        (*prepared)[side].hash,
        HashGeodesics((*prepared)[side].solved(), options.pool_size,
                      progress->Share(side, 2), stop));
    return absl::OkStatus();
  }));
  if (SpectralCount(options) > 0) progress->Begin(Stage::kSpectral);
  ISOMATCH_RETURN_IF_ERROR(both([&](Side side) {
    return About(meshes[side]->field,
                 PrepareSpectral(options, stop, &(*prepared)[side]));
  }));
  return both(
      [&](Side side) { return Describe(options, stop, &(*prepared)[side]); });
}

}  // namespace isomatch
