#pragma once

#include <string>
#include <vector>

#include "core/pipeline/correspondence.h"
#include "server/storage/job_record.h"

namespace isomatch {

/// The bytes of one part of a result, as clients get them.
struct EncodedPart {
  ResultPart part = ResultPart::kMap;
  std::string bytes;
};

/// Returns the map and every other part that `found` has, by increasing number.
/// What the method left empty is no part. core/io/result_bytes.h has the
/// layout.
std::vector<EncodedPart> EncodeParts(const Correspondence& found);

}  // namespace isomatch
