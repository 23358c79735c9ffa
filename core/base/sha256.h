#pragma once

#include <memory>
#include <string>

#include "absl/strings/string_view.h"

struct evp_md_ctx_st;

namespace isomatch {

/// SHA-256 of bytes that come in pieces. Not thread-safe.
class Sha256 {
 public:
  Sha256();
  ~Sha256();

  void Update(absl::string_view bytes);

  /// Returns the 64 lower-case hexadecimal digits. Call once, last.
  std::string HexDigest();

 private:
  struct Free {
    void operator()(evp_md_ctx_st* context) const;
  };
  std::unique_ptr<evp_md_ctx_st, Free> context_;
};

/// Returns the 64 lower-case hexadecimal digits of the SHA-256 of `bytes`.
std::string Sha256Hex(absl::string_view bytes);

/// True for 64 lower-case hexadecimal digits.
bool IsSha256Hex(absl::string_view text);

}  // namespace isomatch
