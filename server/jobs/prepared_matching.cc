#include "server/jobs/prepared_matching.h"

#include <optional>
#include <string>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/strip.h"
#include "core/base/status_macros.h"

namespace isomatch {
namespace {

std::optional<PreparedShape> Find(PreparedCache& cache,
                                  const std::optional<BlobKey>& key,
                                  const std::stop_token& stop) {
  return key ? cache.Find(*key, stop) : std::nullopt;
}

void KeepIfNamed(PreparedCache& cache, const std::optional<BlobKey>& key,
                 const PreparedShape& shape) {
  if (key) cache.Keep(*key, shape);
}

/// What Prepare says of its only mesh, said of `field` of the pair.
absl::Status About(const std::string& field, const absl::Status& status) {
  absl::string_view problem = status.message();
  if (!absl::ConsumePrefix(&problem, "mesh: ")) return status;
  return {status.code(), absl::StrCat(field, ": ", problem)};
}

/// Prepares the shapes that are not there.
absl::Status Complete(const MatchEngine& engine, const JobSpec& spec,
                      const ProgressCallback& progress,
                      const std::stop_token& stop,
                      std::optional<PreparedShape>& x,
                      std::optional<PreparedShape>& y) {
  if (!x && !y) {
    ISOMATCH_ASSIGN_OR_RETURN(
        PreparedPair pair, engine.prepare_both(spec.mesh_x, spec.mesh_y,
                                               spec.options, progress, stop));
    x = std::move(pair.x);
    y = std::move(pair.y);
    return absl::OkStatus();
  }
  absl::StatusOr<PreparedShape> missing = engine.prepare(
      x ? spec.mesh_y : spec.mesh_x, spec.options, progress, stop);
  if (!missing.ok()) return About(x ? "mesh_y" : "mesh_x", missing.status());
  (x ? y : x) = *std::move(missing);
  return absl::OkStatus();
}

/// The reports of a match whose shapes have been reported already.
ProgressCallback AfterPreparation(const ProgressCallback& progress) {
  return [&progress](const Progress& report) {
    if (report.stage > Stage::kSpectral) progress(report);
  };
}

}  // namespace

absl::StatusOr<Correspondence> MatchWithCache(const MatchEngine& engine,
                                              const JobSpec& spec,
                                              PreparedCache& cache,
                                              const ProgressCallback& progress,
                                              const std::stop_token& stop) {
  std::optional<PreparedShape> x = Find(cache, spec.prepared_x, stop);
  std::optional<PreparedShape> y = Find(cache, spec.prepared_y, stop);
  if (x && y) {
    return engine.match_prepared(*x, *y, spec.landmarks, spec.options, progress,
                                 stop);
  }
  ISOMATCH_RETURN_IF_ERROR(Complete(engine, spec, progress, stop, x, y));
  KeepIfNamed(cache, spec.prepared_x, *x);
  KeepIfNamed(cache, spec.prepared_y, *y);
  return engine.match_prepared(*x, *y, spec.landmarks, spec.options,
                               AfterPreparation(progress), stop);
}

}  // namespace isomatch
