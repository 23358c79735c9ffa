#include "server/rpc/security/new_api_key.h"

#include <openssl/rand.h>

#include "server/jobs/caller.h"
#include "server/rpc/security/api_keys.h"

namespace isomatch {

int PrintNewApiKey(const NewApiKeyRequest& request, std::ostream& out,
                   std::ostream& err) {
  std::string bytes(32, '\0');
  if (RAND_bytes(reinterpret_cast<unsigned char*>(bytes.data()),
                 static_cast<int>(bytes.size())) != 1) {
    err << "isomatch-server: the system has no random numbers\n";
    return 1;
  }
  const Caller caller{request.tenant,
                      ParseRole(request.role).value_or(Role::kRead)};
  const NewApiKey made = MakeApiKey(request.name, caller, bytes);
  out << made.line << std::endl;
  err << "# The API key of " << request.name << ", shown only now:\n"
      << made.key << std::endl;
  return out && err ? 0 : 1;
}

}  // namespace isomatch
