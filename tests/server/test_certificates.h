#pragma once

#include <memory>
#include <string>

#include "absl/time/time.h"

struct evp_pkey_st;
struct x509_st;

namespace isomatch {

/// PEM of a certificate and of its private key.
struct TestCertificate {
  std::string certificate;
  std::string key;
};

/// An authority with a fresh key (P-256) that signs certificates for tests.
class TestAuthority {
 public:
  explicit TestAuthority(const std::string& name = "test authority");
  ~TestAuthority();

  /// Its own certificate, PEM.
  const std::string& certificate() const { return certificate_; }

  /// Returns a certificate for 127.0.0.1 and localhost with a fresh key, valid
  /// from a day ago until `lasts` from now.
  TestCertificate Issue(absl::Duration lasts = absl::Hours(1)) const;

 private:
  struct Free {
    void operator()(evp_pkey_st* key) const;
    void operator()(x509_st* certificate) const;
  };

  std::unique_ptr<evp_pkey_st, Free> key_;
  std::unique_ptr<x509_st, Free> own_;
  std::string certificate_;
};

}  // namespace isomatch
