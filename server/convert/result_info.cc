#include "server/convert/result_info.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <vector>

#include <google/protobuf/util/json_util.h>
#include <nlohmann/json.hpp>

#include "absl/strings/string_view.h"
#include "core/pipeline/match_options.h"
#include "core/pipeline/verdict.h"

namespace isomatch {
namespace {

// These enums of core and of the proto count alike.
static_assert(static_cast<int>(Profile::kDefault) + 1 == v1::PROFILE_DEFAULT);
static_assert(static_cast<int>(Profile::kPaper) + 1 == v1::PROFILE_PAPER);
static_assert(static_cast<int>(Relation::kWhole) == v1::RELATION_WHOLE);
static_assert(static_cast<int>(Relation::kPartOfY) == v1::RELATION_PART_OF_Y);
static_assert(static_cast<int>(Relation::kPartOfX) == v1::RELATION_PART_OF_X);
static_assert(static_cast<int>(Relation::kOverlap) == v1::RELATION_OVERLAP);
static_assert(static_cast<int>(Relation::kAuto) == v1::RELATION_AUTO);
static_assert(static_cast<int>(kRelations.back()) == v1::Relation_MAX);
static_assert(static_cast<int>(VerdictLevel::kBad) == v1::Verdict::LEVEL_BAD);

void SetSummary(MeshSize size, double area,
                const std::vector<std::string>& warnings,
                v1::MeshSummary& proto) {
  proto.set_vertices(static_cast<std::uint32_t>(size.vertices));
  proto.set_faces(static_cast<std::uint32_t>(size.faces));
  proto.set_area(area);
  proto.mutable_warnings()->Add(warnings.begin(), warnings.end());
}

void SetScores(const MapScores& scores, v1::MapScores& proto) {
  proto.set_embedding_error(scores.embedding_error);
  proto.set_orientation_score(scores.orientation_score);
  proto.set_curvature_mismatch(scores.curvature_mismatch);
  proto.set_normal_mismatch(scores.normal_mismatch);
  proto.set_descriptor_mismatch(scores.descriptor_mismatch);
  proto.set_stretch(scores.stretch);
  proto.set_landmark_contradiction(scores.landmark_contradiction);
  proto.set_rank_value(scores.rank_value);
}

void SetQuality(const MapQuality& quality, v1::MapQuality& proto) {
  proto.set_geodesic_distortion(quality.geodesic_distortion);
  proto.set_coverage(quality.coverage);
  proto.set_area_distortion(quality.area_distortion);
  proto.set_mean_confidence(quality.mean_confidence);
}

void SetVerdict(const Verdict& verdict, v1::Verdict& proto) {
  proto.set_level(static_cast<v1::Verdict::Level>(verdict.level));
  proto.set_reason(verdict.reason);
  proto.set_advice(verdict.advice);
}

void SetLandmark(const Landmark& landmark, const LandmarkOutcome& outcome,
                 v1::LandmarkOutcome& proto) {
  proto.mutable_landmark()->set_x(static_cast<std::uint32_t>(landmark.x));
  proto.mutable_landmark()->set_y(static_cast<std::uint32_t>(landmark.y));
  proto.set_kept(outcome.kept);
  proto.set_y_found(static_cast<std::uint32_t>(outcome.y_found));
  proto.set_distance(outcome.distance);
}

/// What the API has twice.
void RepeatScores(v1::ResultInfo& info) {
  info.set_embedding_error(info.scores().embedding_error());
  info.set_orientation_score(info.scores().orientation_score());
}

/// JSON has no infinite numbers; those of protobuf's are words.
void NameInfinities(nlohmann::json& value) {
  if (value.is_number_float() && !std::isfinite(value.get<double>())) {
    const double number = value.get<double>();
    value = std::isnan(number) ? "NaN" : number > 0 ? "Infinity" : "-Infinity";
  }
  if (!value.is_structured()) return;
  for (nlohmann::json& element : value) NameInfinities(element);
}

/// Old records have the names of the proto, but for these differences. Throws
/// what nlohmann::json does. Returns whether it is one.
bool ParseOldInfo(const std::string& bytes, v1::ResultInfo& info) {
  nlohmann::json old = nlohmann::json::from_cbor(bytes);
  NameInfinities(old);
  for (nlohmann::json& scores : old["alternatives"]) {
    scores = nlohmann::json::object({{"scores", scores}});
  }
  for (nlohmann::json& landmark : old["landmarks"]) {
    landmark["y_found"] =
        static_cast<std::uint32_t>(landmark.value("y_found", -1));
  }
  old["profile"] = old.value("profile", 0) + 1;
  old["random_seed"] =
      std::to_string(old.value("random_seed", std::uint64_t{0}));
  google::protobuf::util::JsonParseOptions options;
  options.ignore_unknown_fields = true;
  const bool is_one =
      google::protobuf::util::JsonStringToMessage(old.dump(), &info, options)
          .ok();
  RepeatScores(info);
  return is_one;
}

v1::ResultInfo Unreadable() {
  v1::ResultInfo info;
  info.add_warnings("what was known of this map cannot be read any more");
  return info;
}

}  // namespace

std::string DescribeResult(const JobSpec& spec, MeshSize size_x,
                           MeshSize size_y, const Correspondence& found) {
  v1::ResultInfo info;
  SetSummary(size_x, found.area_x, found.warnings_x, *info.mutable_mesh_x());
  SetSummary(size_y, found.area_y, found.warnings_y, *info.mutable_mesh_y());
  info.set_unmatched(static_cast<std::uint32_t>(
      std::count(found.y_from_x.begin(), found.y_from_x.end(), kNoVertex)));
  SetScores(found.scores, *info.mutable_scores());
  RepeatScores(info);
  info.set_objective(found.objective);
  SetQuality(found.quality, *info.mutable_quality());
  SetVerdict(found.verdict, *info.mutable_verdict());
  info.set_symmetry_confidence(found.symmetry_confidence);
  for (const Alternative& alternative : found.alternatives) {
    SetScores(alternative.scores, *info.add_alternatives()->mutable_scores());
  }
  for (std::size_t i = 0; i < found.landmarks.size(); ++i) {
    SetLandmark(spec.landmarks[i], found.landmarks[i], *info.add_landmarks());
  }
  for (const auto* warnings : {&spec.warnings, &found.warnings}) {
    info.mutable_warnings()->Add(warnings->begin(), warnings->end());
  }
  info.set_profile(
      static_cast<v1::Profile>(static_cast<int>(spec.options.profile) + 1));
  info.set_random_seed(spec.options.random_seed);
  info.set_relation(static_cast<v1::Relation>(found.relation));
  info.set_scale(found.scale);
  info.set_relation_confidence(found.relation_confidence);
  info.set_ended_early(found.ended_early);
  return info.SerializeAsString();
}

v1::ResultInfo ResultInfoOf(const JobResult& result) {
  v1::ResultInfo info;
  try {
    const bool is_one = result.old_info.empty()
                            ? info.ParseFromString(result.info)
                            : ParseOldInfo(result.old_info, info);
    return is_one ? info : Unreadable();
  } catch (const nlohmann::json::exception&) {
    return Unreadable();
  }
}

}  // namespace isomatch
