#include <cmath>
#include <cstdint>
#include <cstring>
#include <utility>

#include "client/c/objects.h"

namespace {

bool IsIn(std::int64_t index, std::size_t size) {
  return index >= 0 && static_cast<std::size_t>(index) < size;
}

}  // namespace

void isomatch_result_free(isomatch_result* result) { delete result; }

std::int64_t isomatch_result_num_vertices(const isomatch_result* result) {
  return static_cast<std::int64_t>(result->found.y_from_x.size());
}

const std::int32_t* isomatch_result_map(const isomatch_result* result) {
  return result->found.y_from_x.data();
}

const float* isomatch_result_confidence(const isomatch_result* result) {
  return result->found.confidence.data();
}

std::int64_t isomatch_result_num_vertices_y(const isomatch_result* result) {
  return static_cast<std::int64_t>(result->found.matched_y.size());
}

const std::uint8_t* isomatch_result_mask_y(const isomatch_result* result) {
  return reinterpret_cast<const std::uint8_t*>(result->found.matched_y.data());
}

const std::int32_t* isomatch_result_precise_vertices(
    const isomatch_result* result) {
  return result->precise_vertices.data();
}

const double* isomatch_result_precise_weights(const isomatch_result* result) {
  return result->precise_weights.data();
}

std::int64_t isomatch_result_num_alternatives(const isomatch_result* result) {
  return static_cast<std::int64_t>(result->found.alternatives.size());
}

const std::int32_t* isomatch_result_alternative(const isomatch_result* result,
                                                std::int64_t index) {
  const auto& alternatives = result->found.alternatives;
  if (!IsIn(index, alternatives.size())) return nullptr;
  return alternatives[static_cast<std::size_t>(index)].y_from_x.data();
}

const char* isomatch_result_verdict(const isomatch_result* result) {
  return isomatch::VerdictName(result->found.verdict.level);
}

const char* isomatch_result_verdict_reason(const isomatch_result* result) {
  return result->found.verdict.reason.c_str();
}

const char* isomatch_result_verdict_advice(const isomatch_result* result) {
  return result->found.verdict.advice.c_str();
}

double isomatch_result_figure(const isomatch_result* result, const char* name) {
  const isomatch::Correspondence& found = result->found;
  const std::pair<const char*, double> figures[] = {
      {"symmetry_confidence", found.symmetry_confidence},
      {"mean_confidence", found.quality.mean_confidence},
      {"coverage", found.quality.coverage},
      {"geodesic_distortion", found.quality.geodesic_distortion},
      {"area_distortion", found.quality.area_distortion},
      {"orientation_score", found.scores.orientation_score},
      {"embedding_error", found.scores.embedding_error},
      {"objective", found.objective},
      {"relation_confidence", found.relation_confidence},
      {"scale", found.scale},
      {"ended_early", found.ended_early ? 1 : 0},
      {"area_x", found.area_x},
      {"area_y", found.area_y}};
  for (const auto& [known, value] : figures) {
    if (std::strcmp(known, name) == 0) return value;
  }
  return std::nan("");
}

std::int64_t isomatch_result_num_warnings(const isomatch_result* result) {
  return static_cast<std::int64_t>(result->warnings.size());
}

const char* isomatch_result_warning(const isomatch_result* result,
                                    std::int64_t index) {
  if (!IsIn(index, result->warnings.size())) return nullptr;
  return result->warnings[static_cast<std::size_t>(index)].c_str();
}

int isomatch_result_landmark_kept(const isomatch_result* result,
                                  std::int64_t index) {
  const auto& landmarks = result->found.landmarks;
  if (!IsIn(index, landmarks.size())) return -1;
  return landmarks[static_cast<std::size_t>(index)].kept ? 1 : 0;
}

const char* isomatch_result_report(const isomatch_result* result) {
  return result->report.c_str();
}

std::int64_t isomatch_result_functional_map_size(
    const isomatch_result* result) {
  return result->found.functional_map.rows();
}

const double* isomatch_result_functional_map(const isomatch_result* result) {
  return result->functional_map.data();
}

const double* isomatch_result_eigenvalues_x(const isomatch_result* result) {
  return result->found.eigenvalues_x.data();
}

const double* isomatch_result_eigenvalues_y(const isomatch_result* result) {
  return result->found.eigenvalues_y.data();
}
