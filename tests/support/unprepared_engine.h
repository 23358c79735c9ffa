#pragma once

#include <memory>
#include <stop_token>
#include <utility>
#include <variant>

#include "absl/status/statusor.h"
#include "core/pipeline/match_engine.h"
#include "core/pipeline/shape_contents.h"

namespace isomatch {

/// The core's engine, but shapes have nothing but their meshes, whatever those
/// are: for tests that put their own `match` in its place.
inline MatchEngine UnpreparedEngine() {
  MatchEngine engine = CoreMatchEngine();
  engine.prepare_both = [](ShapeSource x, ShapeSource y, auto&&...) {
    const auto shape = [](ShapeSource& source) {
      auto* mesh = std::get_if<SharedMesh>(&source);
      if (mesh == nullptr) return std::get<PreparedShape>(source);
      return PreparedShape(std::make_shared<PreparedShape::Contents>(
          PreparedShape::Contents{.mesh = std::move(*mesh)}));
    };
    return PreparedPair{shape(x), shape(y)};
  };
  return engine;
}

}  // namespace isomatch
