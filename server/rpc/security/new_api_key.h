#pragma once

#include <ostream>
#include <string>

namespace isomatch {

/// What --new-api-key asks for.
struct NewApiKeyRequest {
  /// Empty when it does not; passes IsTenantName, as the tenant does.
  std::string name;
  std::string tenant = "default";
  /// read, submit or admin.
  std::string role = "submit";
};

/// Makes a fresh key. Writes its line for the key file to `out`; the key to
/// `err`, under a line that begins with #, so that all of `err` can be the
/// client's --api-key-file. It is kept nowhere. Returns the exit status: 0, or
/// 1 when there is no randomness or `out` or `err` cannot be written.
int PrintNewApiKey(const NewApiKeyRequest& request, std::ostream& out,
                   std::ostream& err);

}  // namespace isomatch
