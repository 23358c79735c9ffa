#include "server/convert/digest.h"

#include "absl/strings/str_cat.h"
#include "core/base/sha256.h"
#include "server/jobs/errors.h"

namespace isomatch {

absl::Status ValidateDigest(const v1::Digest& digest, const std::string& field,
                            const RequestLimits& limits) {
  if (!IsSha256Hex(digest.sha256())) {
    return InvalidField(field + ".sha256",
                        absl::StrCat("expected 64 lower-case hexadecimal "
                                     "digits, found ",
                                     digest.sha256().size(), " bytes"));
  }
  if (digest.size_bytes() > static_cast<std::uint64_t>(limits.max_mesh_bytes)) {
    return MeshTooLarge(field + ".size_bytes",
                        static_cast<std::int64_t>(digest.size_bytes()),
                        limits.max_mesh_bytes);
  }
  return absl::OkStatus();
}

}  // namespace isomatch
