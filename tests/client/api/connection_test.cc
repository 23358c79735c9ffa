// The client against a server that asks for TLS, certificates and keys.

#include "client/api/connection.h"

#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "client/api/isomatch_client.h"
#include "core/base/sha256.h"
#include "tests/server/test_certificates.h"
#include "tests/server/test_server.h"
#include "tests/support/matchers.h"
#include "tests/support/shapes.h"
#include "tests/support/temporary_folder.h"

namespace isomatch {
namespace {

using testing::HasSubstr;

class ConnectionTest : public TestServer {
 protected:
  ConnectionTest() {
    const TestCertificate server = authority_.Issue();
    ServerConfig config = TestConfig();
    config.tls_cert = folder_.Write("crt", server.certificate);
    config.tls_key = folder_.Write("key", server.key);
    config.tls_client_ca = folder_.Write("ca", authority_.certificate());
    config.api_keys =
        folder_.Write("keys", "alice lab submit " + Sha256Hex("alice's"));
    Restart(config);
  }

  // What the server asks for.
  ConnectionSecurity Everything() const {
    const TestCertificate own = authority_.Issue();
    return {authority_.certificate(), own.certificate, own.key, "alice's"};
  }

  absl::StatusOr<v1::GetServerInfoResponse> Ask(
      const ConnectionSecurity& security) const {
    return IsomatchClient(ConnectTo(server_->address(), security))
        .GetServerInfo();
  }

  const TestAuthority authority_;
  const TemporaryFolder folder_;
};

TEST_F(ConnectionTest, AMatchGoesThroughWithTlsCertificateAndKey) {
  MatchRequest request;
  request.mesh_x = UnitSphere(1);
  request.mesh_y = Tetrahedron();
  const auto result =
      IsomatchClient(ConnectTo(server_->address(), Everything()))
          .Match(request);
  ASSERT_THAT(result, IsOk());
  EXPECT_EQ(result->y_from_x.size(), request.mesh_x.num_vertices());
}

TEST_F(ConnectionTest, TheKeyIsThatOfItsTenant) {
  const auto info = Ask(Everything());
  ASSERT_THAT(info, IsOk());
  EXPECT_EQ(info->tenant(), "lab");
}

TEST_F(ConnectionTest, WhatIsMissingOrWrongIsToldAsAStatus) {
  ConnectionSecurity security = Everything();
  security.api_key = "";
  EXPECT_THAT(Ask(security), StatusIs(absl::StatusCode::kUnauthenticated,
                                      HasSubstr("API_KEY_MISSING")));
  security.api_key = "bob's";
  EXPECT_THAT(Ask(security), StatusIs(absl::StatusCode::kUnauthenticated,
                                      HasSubstr("API_KEY_WRONG")));
  security = Everything();
  security.ca_pem = TestAuthority("another").certificate();
  EXPECT_THAT(Ask(security),
              StatusIs(absl::StatusCode::kUnavailable, HasSubstr("no answer")));
  security = Everything();
  security.certificate_pem = security.key_pem = "";
  EXPECT_EQ(Ask(security).status().code(), absl::StatusCode::kUnavailable);
  EXPECT_EQ(Ask({}).status().code(), absl::StatusCode::kUnavailable);
}

TEST(ApiKeyTextTest, IsWhatMetadataCanCarry) {
  EXPECT_TRUE(IsApiKeyText("isomatch_A-z0_9"));
  EXPECT_TRUE(IsApiKeyText(std::string(1024, 'k')));
  for (const std::string& text :
       {std::string(), std::string("a b"), std::string("a\n"),
        std::string("\xc3\xa4"), std::string("a\0", 2),
        std::string(1025, 'k')}) {
    EXPECT_FALSE(IsApiKeyText(text)) << text;
  }
}

}  // namespace
}  // namespace isomatch
