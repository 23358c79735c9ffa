#include "server/rpc/security/tls_files.h"

#include <memory>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <openssl/bio.h>
#include <openssl/ec.h>
#include <openssl/err.h>
#include <openssl/evp.h>
#include <openssl/pem.h>

#include "tests/server/test_certificates.h"
#include "tests/support/matchers.h"
#include "tests/support/temporary_folder.h"

namespace isomatch {
namespace {

using testing::AllOf;
using testing::HasSubstr;

/// A private key that only a password opens.
std::string LockedKey() {
  const std::unique_ptr<EVP_PKEY, decltype(&EVP_PKEY_free)> key(
      EVP_EC_gen("P-256"), EVP_PKEY_free);
  const std::unique_ptr<BIO, decltype(&BIO_free)> pem(BIO_new(BIO_s_mem()),
                                                      BIO_free);
  PEM_write_bio_PKCS8PrivateKey(pem.get(), key.get(), EVP_aes_128_cbc(),
                                "isomatch", 8, nullptr, nullptr);
  char* data = nullptr;
  const auto size = BIO_get_mem_data(pem.get(), &data);
  return {data, static_cast<size_t>(size)};
}

class TlsFilesTest : public testing::Test {
 protected:
  /// Checks how these files are refused, and that the message names `path`.
  static void ExpectRefused(const TlsFiles& files, const std::string& path,
                            const std::string& problem) {
    EXPECT_THAT(ReadTlsFiles(files),
                StatusIs(absl::StatusCode::kInvalidArgument,
                         AllOf(HasSubstr(path), HasSubstr(problem))));
    EXPECT_EQ(ERR_peek_error(), 0) << "left in OpenSSL's queue";
  }

  const TestAuthority authority_;
  const TestCertificate own_ = authority_.Issue();
  const TemporaryFolder folder_;
  const std::string certificate_ = folder_.Write("crt", own_.certificate);
  const std::string key_ = folder_.Write("key", own_.key);
  const std::string ca_ = folder_.Write("ca", authority_.certificate());
  const std::string none_ = folder_.Path("none");
};

TEST_F(TlsFilesTest, FilesThatBelongTogetherAreTaken) {
  const auto alone = ReadTlsFiles({certificate_, key_, ""});
  ASSERT_THAT(alone, IsOk());
  EXPECT_THAT(alone->identity_pem,
              AllOf(HasSubstr(own_.certificate), HasSubstr(own_.key)));
  EXPECT_EQ(alone->client_ca_pem, "");
  const auto with_ca = ReadTlsFiles({certificate_, key_, ca_});
  ASSERT_THAT(with_ca, IsOk());
  EXPECT_EQ(with_ca->client_ca_pem, authority_.certificate());
}

TEST_F(TlsFilesTest, OneFileOfBothIsNotDoubled) {
  const std::string both = folder_.Write("both", own_.certificate + own_.key);
  const auto content = ReadTlsFiles({both, both, ""});
  ASSERT_THAT(content, IsOk());
  EXPECT_EQ(content->identity_pem, own_.certificate + own_.key);
}

TEST_F(TlsFilesTest, MissingFilesAreNamed) {
  ExpectRefused({none_, key_, ""}, "--tls-cert = " + none_, "No such file");
  ExpectRefused({certificate_, none_, ""}, "--tls-key = " + none_,
                "No such file");
  ExpectRefused({certificate_, key_, none_}, "--tls-client-ca = " + none_,
                "No such file");
  const std::string folder = folder_.Path("");
  ExpectRefused({certificate_, key_, folder}, "--tls-client-ca = " + folder,
                "no regular file");
}

TEST_F(TlsFilesTest, WhatIsNoPemIsNamed) {
  const std::string text = folder_.Write("text", "no PEM");
  ExpectRefused({text, key_, ""}, "--tls-cert = " + text,
                "expected a certificate in PEM");
  ExpectRefused({certificate_, text, ""}, "--tls-key = " + text,
                "expected a private key in PEM");
  ExpectRefused({certificate_, key_, text}, "--tls-client-ca = " + text,
                "expected a certificate in PEM");
  ExpectRefused({key_, key_, ""}, "--tls-cert = " + key_,
                "expected a certificate in PEM");
}

TEST_F(TlsFilesTest, AnotherCertificatesKeyIsRefused) {
  const std::string other = folder_.Write("other", authority_.Issue().key);
  ExpectRefused({certificate_, other, ""}, "--tls-key = " + other,
                "expected the key of the first certificate in --tls-cert = " +
                    certificate_);
}

TEST_F(TlsFilesTest, AKeyWithPasswordIsRefusedWithoutAskingForIt) {
  const std::string locked = folder_.Write("locked", LockedKey());
  ExpectRefused({certificate_, locked, ""}, "--tls-key = " + locked,
                "without password");
}

}  // namespace
}  // namespace isomatch
