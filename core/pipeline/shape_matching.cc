#include "core/pipeline/shape_matching.h"

#include <algorithm>
#include <array>
#include <memory>
#include <optional>
#include <stop_token>
#include <string>
#include <utility>
#include <variant>

#include "core/base/parallel.h"
#include "core/base/status_macros.h"
#include "core/matching/matching.h"
#include "core/pipeline/component_matching.h"
#include "core/pipeline/landmarks.h"
#include "core/pipeline/match_run.h"
#include "core/pipeline/memory_plan.h"
#include "core/pipeline/part_start.h"
#include "core/pipeline/preparation.h"
#include "core/pipeline/progress_reporter.h"
#include "core/pipeline/relation_search.h"
#include "core/pipeline/shape_contents.h"
#include "core/pipeline/stage_plan.h"
#include "core/pipeline/torn_maps.h"

namespace isomatch {
namespace {

/// A shape on its way to being prepared.
struct ShapeToPrepare {
  std::shared_ptr<PreparedShape::Contents> contents;
  /// What errors call it.
  std::string field;
};

using ShapesToPrepare = std::array<std::optional<ShapeToPrepare>, 2>;

ShapeToPrepare NewShape(SharedMesh mesh, const MatchOptions& options,
                        const std::string& field) {
  return {std::make_shared<PreparedShape::Contents>(PreparedShape::Contents{
              .mesh = std::move(mesh), .key = PreparationKey::Of(options)}),
          field};
}

/// Splits the mesh; the shape keeps its components where they are matched one
/// by one, and is to be prepared as a whole otherwise.
absl::Status Split(const ShapeToPrepare& shape, const MatchOptions& options,
                   const std::stop_token& stop,
                   std::optional<MeshToPrepare>* whole) {
  PreparedShape::Contents& contents = *shape.contents;
  ISOMATCH_ASSIGN_OR_RETURN(SplitMesh found,
                            SplitIntoComponents(*contents.mesh, stop));
  contents.large_components = static_cast<std::int32_t>(found.large.size());
  if (options.match_components && MatchedByComponents(found.large.size())) {
    contents.split = std::move(found);
  } else {
    *whole = {std::move(found.clean), shape.field};
  }
  return absl::OkStatus();
}

/// Fills in what the one or two shapes lack.
absl::Status PrepareShapes(const ShapesToPrepare& shapes,
                           const MatchOptions& options,
                           const MatchControl& control) {
  const ProgressCallback& progress = control.progress;
  const std::stop_token& stop = control.stop;
  // Cleaning takes its time and comes before all reports.
  if (progress) progress({Stage::kPrepare, 0, 0});
  std::array<std::optional<MeshToPrepare>, 2> wholes;
  const auto split = [&](Side side) {
    return shapes[side] ? Split(*shapes[side], options, stop, &wholes[side])
                        : absl::OkStatus();
  };
  absl::Status status = absl::InternalError("not run");
  RunWithThreads(options.threads, [&] {
    status = RunBoth([&] { return split(kX); }, [&] { return split(kY); });
    std::array<bool, 2> is_whole = {wholes[kX].has_value(),
                                    wholes[kY].has_value()};
    if (!status.ok() || !(is_whole[kX] || is_whole[kY])) return;
    ProgressReporter reporter(progress, StagePlan(options));
    std::array<PreparedMesh, 2> prepared;
    status =
        PrepareMeshes(std::move(wholes), options, &reporter, stop, &prepared);
    for (const Side side : {kX, kY}) {
      if (is_whole[side]) {
        shapes[side]->contents->whole = std::move(prepared[side]);
      }
    }
  });
  return status;
}

/// What is asked for of two shapes.
struct Request {
  absl::Span<const Landmark> landmarks;
  const MatchOptions& options;
  const MatchControl& control;
};

/// Matches whole shapes, again where the map is torn, which is not reported and
/// leaves X as it is. Landmarks may want X mirrored, and are obeyed at once.
absl::StatusOr<Correspondence> MatchWholes(const MatchInputs& inputs,
                                           ProgressReporter* reporter,
                                           const StopTokens& stops) {
  if (!inputs.landmarks.empty()) return RunMatch(inputs, reporter, stops);
  bool is_first = true;
  return MatchUntilNotTorn(
      inputs.options, stops,
      [&](const MatchOptions& options, const StopTokens& ends) {
        if (std::exchange(is_first, false)) {
          return RunMatch(inputs, reporter, ends);
        }
        auto plan = StagePlan(options);
        std::erase_if(plan, [](const auto& stage) {
          return stage.first < Stage::kSeeds;  // both are prepared
        });
        ProgressReporter silent({}, std::move(plan));
        return RunMatch({inputs.x, nullptr, inputs.y, {}, options}, &silent,
                        ends);
      });
}

/// Each component is prepared when its turn comes.
absl::StatusOr<Correspondence> PrepareAndMatchComponents(
    const PreparedShape& x, const PreparedShape& y, const Request& request) {
  const MatchOptions& options = request.options;
  const std::stop_token& stop = request.control.stop;
  const std::array<const PreparedShape::Contents*, 2> shapes = {&x.contents(),
                                                                &y.contents()};
  std::array<SplitMesh, 2> own;  // of one that was prepared as a whole
  std::array<const SplitMesh*, 2> splits;
  const auto find = [&](Side side) -> absl::Status {
    const PreparedShape::Contents& shape = *shapes[side];
    splits[side] = shape.split ? &*shape.split : &own[side];
    if (shape.split) return absl::OkStatus();
    ISOMATCH_ASSIGN_OR_RETURN(own[side],
                              SplitIntoComponents(*shape.mesh, stop));
    return absl::OkStatus();
  };
  ISOMATCH_RETURN_IF_ERROR(
      RunBoth([&] { return find(kX); }, [&] { return find(kY); }));
  const auto match_one =
      [&](const TriangleMesh& component_x, const TriangleMesh& component_y,
          absl::Span<const Landmark> known,
          const ProgressCallback& report) -> absl::StatusOr<Correspondence> {
    ISOMATCH_ASSIGN_OR_RETURN(CleanMesh clean_x, Clean(component_x, stop));
    ISOMATCH_ASSIGN_OR_RETURN(CleanMesh clean_y, Clean(component_y, stop));
    ProgressReporter reporter(report, StagePlan(options));
    std::array<PreparedMesh, 2> prepared;
    ISOMATCH_RETURN_IF_ERROR(
        PrepareMeshes({MeshToPrepare{std::move(clean_x), "mesh_x"},
                       MeshToPrepare{std::move(clean_y), "mesh_y"}},
                      options, &reporter, stop, &prepared));
    return MatchWholes(
        {prepared[kX], &prepared[kX], prepared[kY], known, options}, &reporter,
        {stop, request.control.hurry});
  };
  return MatchByComponents({*shapes[kX]->mesh, *splits[kX], *splits[kY]},
                           request.landmarks, match_one, request.control);
}

/// Brings X into Y's unit and matches it.
absl::StatusOr<Correspondence> MatchInOneUnit(const MatchInputs& inputs,
                                              ProgressReporter* reporter,
                                              const StopTokens& stops) {
  reporter->Begin(Stage::kSeeds);
  ISOMATCH_ASSIGN_OR_RETURN(
      const PartStart start,
      FindPartStart(inputs.x, inputs.y, inputs.landmarks, inputs.options,
                    {reporter->Share(0, 1), stops.stop}));
  PreparedMesh copy;
  PreparedMesh* own_x = inputs.own_x;
  if (own_x == nullptr) own_x = &(copy = inputs.x);
  ISOMATCH_RETURN_IF_ERROR(Rescale(start.scale, inputs.options, own_x));
  return RunMatch(
      {*own_x, own_x, inputs.y, inputs.landmarks, inputs.options, &start},
      reporter, stops);
}

/// Of parts the smaller one, as far as it is known, is mapped to the other.
absl::StatusOr<Correspondence> MatchPart(const MatchInputs& inputs,
                                         ProgressReporter* reporter,
                                         const StopTokens& stops) {
  if (inputs.options.relation != Relation::kPartOfX) {
    return MatchInOneUnit(inputs, reporter, stops);
  }
  // For its errors, which name X and Y as the user does.
  std::vector<std::string> warnings;
  ISOMATCH_RETURN_IF_ERROR(
      TakeLandmarks(inputs.landmarks, inputs.x, inputs.y, &warnings).status());
  std::vector<Landmark> turned;
  for (const Landmark& landmark : inputs.landmarks) {
    turned.push_back({landmark.y, landmark.x});
  }
  return MatchInOneUnit({inputs.y, nullptr, inputs.x, turned, inputs.options},
                        reporter, stops);
}

/// Matches the shapes as one, whatever components they have.
absl::StatusOr<Correspondence> MatchWhole(PreparedShape& x, PreparedShape& y,
                                          const Request& request) {
  const MatchOptions& options = request.options;
  const StopTokens stops = {request.control.stop, request.control.hurry};
  ProgressReporter reporter(request.control.progress, StagePlan(options));
  // A shape that was split is prepared again as one when the other has more
  // components than are matched one by one.
  std::array<PreparedMesh, 2> anew;
  std::array<std::optional<MeshToPrepare>, 2> missing;
  if (x.contents().split) missing[kX] = {x.contents().split->clean, "mesh_x"};
  if (y.contents().split) missing[kY] = {y.contents().split->clean, "mesh_y"};
  ISOMATCH_RETURN_IF_ERROR(
      PrepareMeshes(std::move(missing), options, &reporter, stops.stop, &anew));
  const auto prepared = [&](const PreparedShape& shape, Side side) {
    return shape.contents().whole ? &*shape.contents().whole : &anew[side];
  };
  const PreparedMesh* const whole_x = prepared(x, kX);
  const PreparedMesh* const whole_y = prepared(y, kY);
  PreparedMesh* own_x = x.contents().whole ? nullptr : &anew[kX];
  if (own_x == nullptr && x.own_contents() != nullptr) {
    own_x = &*x.own_contents()->whole;
  }
  ISOMATCH_RETURN_IF_ERROR(
      CheckDecimated(SizesOf(*whole_x), SizesOf(*whole_y), options));
  if (options.relation == Relation::kWhole) {
    return MatchWholes({*whole_x, own_x, *whole_y, request.landmarks, options},
                       &reporter, stops);
  }
  return MatchPart({*whole_x, own_x, *whole_y, request.landmarks, options},
                   &reporter, stops);
}

absl::StatusOr<Correspondence> MatchAsTold(PreparedShape& x, PreparedShape& y,
                                           const Request& request) {
  const MatchOptions& options = request.options;
  const auto most = static_cast<std::size_t>(
      std::max(x.contents().large_components, y.contents().large_components));
  ISOMATCH_ASSIGN_OR_RETURN(Correspondence found,
                            options.match_components &&
                                    options.relation == Relation::kWhole &&
                                    MatchedByComponents(most)
                                ? PrepareAndMatchComponents(x, y, request)
                                : MatchWhole(x, y, request));
  found.verdict = VerdictOf(found);
  return found;
}

ShapeOutline OutlineOf(const PreparedShape& shape) {
  const PreparedShape::Contents& contents = shape.contents();
  if (!contents.whole) return OutlineOf(contents.split->clean.mesh);
  ShapeOutline outline = OutlineOf(contents.whole->solved().mesh);
  outline.area = contents.whole->full.area;
  return outline;
}

absl::StatusOr<Correspondence> MatchAsItSeems(PreparedShape& x,
                                              PreparedShape& y,
                                              const Request& request) {
  const std::array<ShapeOutline, 2> outlines = {OutlineOf(x), OutlineOf(y)};
  // What is matched again must not be changed, as a shape with one holder is.
  std::optional<PreparedPair> held;
  if (MostTries(outlines[kX], outlines[kY], request.options) > 1) {
    held = {x, y};
  }
  return FindRelation(
      outlines[kX], outlines[kY], request.options, request.control,
      [&](const MatchOptions& options, const MatchControl& control) {
        return MatchAsTold(x, y, {request.landmarks, options, control});
      });
}

absl::StatusOr<PreparedShape> PrepareHere(SharedMesh mesh,
                                          const MatchOptions& options,
                                          const MatchControl& control) {
  const ShapeToPrepare shape = NewShape(std::move(mesh), options, "mesh");
  ISOMATCH_RETURN_IF_ERROR(
      PrepareShapes({shape, std::nullopt}, options, control));
  return PreparedShape(shape.contents);
}

absl::StatusOr<PreparedPair> PrepareBothHere(ShapeSource x, ShapeSource y,
                                             const MatchOptions& options,
                                             const MatchControl& control) {
  std::array<ShapeSource*, 2> sources = {&x, &y};
  ShapesToPrepare missing;
  for (const Side side : {kX, kY}) {
    auto* mesh = std::get_if<SharedMesh>(sources[side]);
    if (mesh == nullptr) continue;
    missing[side] =
        NewShape(std::move(*mesh), options, side == kX ? "mesh_x" : "mesh_y");
    *sources[side] = PreparedShape(missing[side]->contents);
  }
  if (missing[kX] || missing[kY]) {
    ISOMATCH_RETURN_IF_ERROR(PrepareShapes(missing, options, control));
  }
  return PreparedPair{std::get<PreparedShape>(std::move(x)),
                      std::get<PreparedShape>(std::move(y))};
}

absl::StatusOr<Correspondence> MatchPreparedHere(
    PreparedShape x, PreparedShape y, absl::Span<const Landmark> landmarks,
    const MatchOptions& options, const MatchControl& control) {
  const Request request = {landmarks, options, control};
  absl::StatusOr<Correspondence> result = absl::InternalError("not run");
  RunWithThreads(options.threads, [&] {
    result = options.relation == Relation::kWhole
                 ? MatchAsTold(x, y, request)
                 : MatchAsItSeems(x, y, request);
  });
  if (result.ok() && result->ended_early) {
    result->warnings.emplace_back(
        "the time was up before all was done: more may give a better map");
  }
  return result;
}

}  // namespace
}  // namespace isomatch

const isomatch::MatchEngine* ISOMATCH_MATCH_ENGINE() {
  static const auto& engine =
      *new isomatch::MatchEngine{.prepare = isomatch::PrepareHere,
                                 .prepare_both = isomatch::PrepareBothHere,
                                 .match = isomatch::MatchPreparedHere,
                                 .parse = isomatch::ParsePreparedShapeHere,
                                 .estimate = isomatch::EstimateMemoryBytes};
  return &engine;
}
