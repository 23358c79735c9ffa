#include "server/rpc/security/tls_files.h"

#include <memory>

#include <openssl/bio.h>
#include <openssl/err.h>
#include <openssl/evp.h>
#include <openssl/pem.h>
#include <openssl/x509.h>

#include "absl/strings/str_cat.h"
#include "core/base/status_macros.h"
#include "server/rpc/security/small_file.h"

namespace isomatch {
namespace {

constexpr char kCertificate[] = "--tls-cert";
constexpr char kKey[] = "--tls-key";
constexpr char kClientCa[] = "--tls-client-ca";

struct Free {
  void operator()(BIO* reader) const { BIO_free(reader); }
  void operator()(X509* certificate) const { X509_free(certificate); }
  void operator()(EVP_PKEY* key) const { EVP_PKEY_free(key); }
};
using Certificate = std::unique_ptr<X509, Free>;
using Key = std::unique_ptr<EVP_PKEY, Free>;

/// Stands for the user: OpenSSL would ask the terminal for a password.
int NoPassword(char*, int, int, void*) { return -1; }

absl::Status Wrong(absl::string_view field, const std::string& path,
                   absl::string_view expected) {
  // The next call in this thread would take OpenSSL's error for its own.
  ERR_clear_error();
  return absl::InvalidArgumentError(
      absl::StrCat(field, " = ", path, ", expected ", expected));
}

std::unique_ptr<BIO, Free> ReaderOf(const std::string& pem) {
  return std::unique_ptr<BIO, Free>(
      BIO_new_mem_buf(pem.data(), static_cast<int>(pem.size())));
}

/// The first certificate of `pem`, what `path` holds.
absl::StatusOr<Certificate> ParseCertificate(absl::string_view field,
                                             const std::string& path,
                                             const std::string& pem) {
  Certificate parsed(
      PEM_read_bio_X509(ReaderOf(pem).get(), nullptr, NoPassword, nullptr));
  if (parsed == nullptr) return Wrong(field, path, "a certificate in PEM");
  return parsed;
}

absl::Status CheckIdentity(const TlsFiles& files,
                           const std::string& certificate_pem,
                           const std::string& key_pem) {
  ISOMATCH_ASSIGN_OR_RETURN(
      const Certificate certificate,
      ParseCertificate(kCertificate, files.certificate, certificate_pem));
  const Key key(PEM_read_bio_PrivateKey(ReaderOf(key_pem).get(), nullptr,
                                        NoPassword, nullptr));
  if (key == nullptr) {
    return Wrong(kKey, files.key, "a private key in PEM, without password");
  }
  if (X509_check_private_key(certificate.get(), key.get()) == 1) {
    return absl::OkStatus();
  }
  return Wrong(kKey, files.key,
               absl::StrCat("the key of the first certificate in ",
                            kCertificate, " = ", files.certificate));
}

}  // namespace

absl::StatusOr<TlsContent> ReadTlsFiles(const TlsFiles& files) {
  ISOMATCH_ASSIGN_OR_RETURN(const std::string certificate_pem,
                            ReadSmallFile(kCertificate, files.certificate));
  ISOMATCH_ASSIGN_OR_RETURN(const std::string key_pem,
                            ReadSmallFile(kKey, files.key));
  ISOMATCH_RETURN_IF_ERROR(CheckIdentity(files, certificate_pem, key_pem));
  TlsContent content;
  // One that is both must not bring its certificates twice.
  content.identity_pem = certificate_pem == key_pem
                             ? key_pem
                             : absl::StrCat(key_pem, "\n", certificate_pem);
  if (files.client_ca.empty()) return content;
  ISOMATCH_ASSIGN_OR_RETURN(content.client_ca_pem,
                            ReadSmallFile(kClientCa, files.client_ca));
  ISOMATCH_RETURN_IF_ERROR(
      ParseCertificate(kClientCa, files.client_ca, content.client_ca_pem)
          .status());
  return content;
}

}  // namespace isomatch
