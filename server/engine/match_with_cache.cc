#include "server/engine/match_with_cache.h"

#include <optional>
#include <utility>

#include "core/base/status_macros.h"
#include "core/pipeline/joined_progress.h"

namespace isomatch {
namespace {

ShapeSource Find(PreparedCache& cache, const std::optional<BlobKey>& key,
                 TriangleMesh mesh, const std::stop_token& stop) {
  std::optional<PreparedShape> found =
      key ? cache.Find(*key, stop) : std::nullopt;
  if (found) return *std::move(found);
  return SharedMesh(std::move(mesh));
}

void KeepIfNamed(PreparedCache& cache, const std::optional<BlobKey>& key,
                 const PreparedShape& shape) {
  if (key) cache.Keep(*key, shape);
}

}  // namespace

absl::StatusOr<Correspondence> MatchWithCache(const MatchEngine& engine,
                                              JobSpec& spec,
                                              PreparedCache& cache,
                                              const MatchControl& control) {
  ShapeSource x =
      Find(cache, spec.prepared_x, std::move(spec.mesh_x), control.stop);
  ShapeSource y =
      Find(cache, spec.prepared_y, std::move(spec.mesh_y), control.stop);
  JoinedProgress joined(control.progress);
  ISOMATCH_ASSIGN_OR_RETURN(
      PreparedPair pair,
      engine.prepare_both(std::move(x), std::move(y), spec.options,
                          control.With(joined.OfPreparation())));
  KeepIfNamed(cache, spec.prepared_x, pair.x);
  KeepIfNamed(cache, spec.prepared_y, pair.y);
  return engine.match(std::move(pair.x), std::move(pair.y), spec.landmarks,
                      spec.options, control.With(joined.OfMatching()));
}

}  // namespace isomatch
