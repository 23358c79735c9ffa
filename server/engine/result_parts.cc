#include "server/engine/result_parts.h"

#include "core/io/result_bytes.h"

namespace isomatch {

std::vector<EncodedPart> EncodeParts(const Correspondence& found) {
  std::vector<EncodedPart> parts;
  parts.push_back({ResultPart::kMap, EncodeMap(found.y_from_x)});
  if (!found.precise.empty()) {
    parts.push_back({ResultPart::kPreciseMap, EncodePreciseMap(found.precise)});
  }
  if (!found.confidence.empty()) {
    parts.push_back(
        {ResultPart::kConfidence, EncodeConfidence(found.confidence)});
  }
  if (!found.alternatives.empty()) {
    parts.push_back({ResultPart::kAlternativeMap,
                     EncodeMap(found.alternatives.front().y_from_x)});
  }
  if (found.functional_map.size() > 0) {
    parts.push_back(
        {ResultPart::kFunctionalMap,
         EncodeFunctionalMap({found.eigenvalues_x, found.eigenvalues_y,
                              found.functional_map})});
  }
  if (!found.matched_y.empty()) {
    parts.push_back({ResultPart::kMaskY, EncodeMask(found.matched_y)});
  }
  return parts;
}

}  // namespace isomatch
