#pragma once

#include <string>

#include "absl/status/status.h"
#include "isomatch/v1/service.pb.h"
#include "server/convert/request_limits.h"

namespace isomatch {

/// Checks that a digest has 64 lower-case hexadecimal digits and a size within
/// the limit of one mesh. `field` is its path in the request.
absl::Status ValidateDigest(const v1::Digest& digest, const std::string& field,
                            const RequestLimits& limits);

}  // namespace isomatch
