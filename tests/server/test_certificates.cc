#include "tests/server/test_certificates.h"

#include <gtest/gtest.h>
#include <openssl/bio.h>
#include <openssl/ec.h>
#include <openssl/evp.h>
#include <openssl/pem.h>
#include <openssl/rand.h>
#include <openssl/x509.h>
#include <openssl/x509v3.h>

namespace isomatch {
namespace {

constexpr absl::Duration kDay = absl::Hours(24);

std::string TakeText(BIO* bio) {
  char* data = nullptr;
  const long size = BIO_get_mem_data(bio, &data);  // NOLINT(runtime/int)
  std::string text(data, static_cast<size_t>(size));
  BIO_free(bio);
  return text;
}

std::string ToPem(X509* certificate) {
  BIO* bio = BIO_new(BIO_s_mem());
  EXPECT_EQ(PEM_write_bio_X509(bio, certificate), 1);
  return TakeText(bio);
}

std::string ToPem(EVP_PKEY* key) {
  BIO* bio = BIO_new(BIO_s_mem());
  EXPECT_EQ(
      PEM_write_bio_PrivateKey(bio, key, nullptr, nullptr, 0, nullptr, nullptr),
      1);
  return TakeText(bio);
}

/// A certificate of `key` that lacks issuer, extensions and signature.
X509* NewCertificate(EVP_PKEY* key, const std::string& name,
                     absl::Duration lasts) {
  X509* certificate = X509_new();
  X509_set_version(certificate, X509_VERSION_3);
  std::uint64_t serial = 0;
  RAND_bytes(reinterpret_cast<unsigned char*>(&serial), sizeof(serial));
  ASN1_INTEGER_set_uint64(X509_get_serialNumber(certificate), serial);
  X509_gmtime_adj(X509_getm_notBefore(certificate),
                  -absl::ToInt64Seconds(kDay));
  X509_gmtime_adj(X509_getm_notAfter(certificate), absl::ToInt64Seconds(lasts));
  X509_set_pubkey(certificate, key);
  X509_NAME_add_entry_by_txt(
      X509_get_subject_name(certificate), "CN", MBSTRING_UTF8,
      reinterpret_cast<const unsigned char*>(name.c_str()), -1, -1, 0);
  return certificate;
}

void AddExtension(X509* certificate, int kind, const char* value) {
  X509V3_CTX context;
  X509V3_set_ctx_nodb(&context);
  X509V3_set_ctx(&context, certificate, certificate, nullptr, nullptr, 0);
  X509_EXTENSION* extension =
      X509V3_EXT_conf_nid(nullptr, &context, kind, value);
  ASSERT_NE(extension, nullptr);
  EXPECT_EQ(X509_add_ext(certificate, extension, -1), 1);
  X509_EXTENSION_free(extension);
}

}  // namespace

void TestAuthority::Free::operator()(evp_pkey_st* key) const {
  EVP_PKEY_free(key);
}
void TestAuthority::Free::operator()(x509_st* certificate) const {
  X509_free(certificate);
}

TestAuthority::TestAuthority(const std::string& name)
    : key_(EVP_EC_gen("P-256")),
      own_(NewCertificate(key_.get(), name, 365 * kDay)) {
  X509_set_issuer_name(own_.get(), X509_get_subject_name(own_.get()));
  AddExtension(own_.get(), NID_basic_constraints, "critical,CA:TRUE");
  EXPECT_GT(X509_sign(own_.get(), key_.get(), EVP_sha256()), 0);
  certificate_ = ToPem(own_.get());
}

TestAuthority::~TestAuthority() = default;

TestCertificate TestAuthority::Issue(absl::Duration lasts) const {
  const std::unique_ptr<EVP_PKEY, Free> key(EVP_EC_gen("P-256"));
  const std::unique_ptr<X509, Free> issued(
      NewCertificate(key.get(), "isomatch test", lasts));
  X509_set_issuer_name(issued.get(), X509_get_subject_name(own_.get()));
  AddExtension(issued.get(), NID_subject_alt_name,
               "IP:127.0.0.1,DNS:localhost");
  EXPECT_GT(X509_sign(issued.get(), key_.get(), EVP_sha256()), 0);
  return {ToPem(issued.get()), ToPem(key.get())};
}

}  // namespace isomatch
