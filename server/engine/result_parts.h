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
/// What the method left empty is no part. All numbers are little-endian, n is
/// the number of vertices of X:
///
///   kMap, kAlternativeMap  n uint32, 0xFFFFFFFF for no match
///   kPreciseMap            n times three uint32 (vertices of a face of Y) and
///                          three float32 (barycentric coordinates)
///   kConfidence            n float32
///   kFunctionalMap         uint32 k, then float64: k eigenvalues of X, k of Y,
///                          the k x k matrix by rows
///
/// float32 where proto/isomatch/v1/service.proto says so: a point is known to
/// far less than 1e-7 of an edge.
std::vector<EncodedPart> EncodeParts(const Correspondence& found);

}  // namespace isomatch
