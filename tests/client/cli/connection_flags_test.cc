#include "client/cli/connection_flags.h"

#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/client/cli/run_isomatch.h"
#include "tests/support/matchers.h"
#include "tests/support/temporary_folder.h"

namespace isomatch {
namespace {

using testing::AllOf;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::Not;

constexpr auto kInvalid = absl::StatusCode::kInvalidArgument;
constexpr char kCertificate[] =
    "-----BEGIN CERTIFICATE-----\nAAAA\n-----END CERTIFICATE-----\n";
constexpr char kKey[] =
    "-----BEGIN EC PRIVATE KEY-----\nAAAA\n-----END EC PRIVATE KEY-----\n";

class ConnectionFlagsTest : public testing::Test {
 protected:
  ConnectionFlagsTest() { flags_.server = "meshes.example.org:7443"; }

  const TemporaryFolder folder_;
  ConnectionFlags flags_;
};

TEST_F(ConnectionFlagsTest, FilesAreReadAndAKeysFileHasComments) {
  flags_.tls_ca = folder_.Write("ca", kCertificate);
  flags_.tls_cert = folder_.Write("crt", std::string(kCertificate) + "x");
  flags_.tls_key = folder_.Write("key", kKey);
  flags_.api_key_file = folder_.Write("api", "# of alice:\n\n isomatch_a \r\n");
  const auto security = LoadSecurity(flags_, "isomatch_other");
  ASSERT_THAT(security, IsOk());
  EXPECT_EQ(security->ca_pem, kCertificate);
  EXPECT_EQ(security->certificate_pem, std::string(kCertificate) + "x");
  EXPECT_EQ(security->key_pem, kKey);
  EXPECT_EQ(security->api_key, "isomatch_a");
  EXPECT_THAT(SecurityWarnings(flags_, *security), IsEmpty());
}

TEST_F(ConnectionFlagsTest, TheEnvironmentsKeyIsTakenWithoutAFile) {
  EXPECT_EQ(LoadSecurity(flags_, "isomatch_a")->api_key, "isomatch_a");
  EXPECT_EQ(LoadSecurity(flags_, "")->api_key, "");
  EXPECT_EQ(LoadSecurity(flags_, nullptr)->api_key, "");
  EXPECT_THAT(LoadSecurity(flags_, "secret key"),
              StatusIs(kInvalid, AllOf(HasSubstr("ISOMATCH_API_KEY"),
                                       Not(HasSubstr("secret")))));
}

TEST_F(ConnectionFlagsTest, FilesThatAreWrongAreNamedWithoutTheirContent) {
  const std::string text = folder_.Write("text", "secret one\nsecret two\n");
  flags_.tls_ca = folder_.Path("none");
  EXPECT_THAT(LoadSecurity(flags_, nullptr),
              StatusIs(absl::StatusCode::kNotFound, HasSubstr("--tls-ca")));
  const auto expect_named = [&](std::string ConnectionFlags::*file) {
    ConnectionFlags flags;
    flags.*file = text;
    EXPECT_THAT(LoadSecurity(flags, nullptr),
                StatusIs(kInvalid, AllOf(HasSubstr("'" + text + "': expected "),
                                         Not(HasSubstr("secret")))));
  };
  expect_named(&ConnectionFlags::tls_ca);
  expect_named(&ConnectionFlags::tls_cert);
  expect_named(&ConnectionFlags::tls_key);
  expect_named(&ConnectionFlags::api_key_file);
}

TEST_F(ConnectionFlagsTest, AKeyThatTravelsOpenlyIsWarnedOf) {
  ConnectionSecurity security;
  security.api_key = "isomatch_a";
  EXPECT_THAT(
      SecurityWarnings(flags_, security),
      ElementsAre(AllOf(HasSubstr("unencrypted"), HasSubstr(flags_.server),
                        Not(HasSubstr("isomatch_a")))));
  for (const char* here : {"127.0.0.1:1", "localhost:1", "unix:/tmp/socket"}) {
    flags_.server = here;
    EXPECT_THAT(SecurityWarnings(flags_, security), IsEmpty());
  }
}

TEST_F(ConnectionFlagsTest, ANameThatBeginsAsLoopbackIsAnotherMachine) {
  ConnectionSecurity security;
  security.api_key = "isomatch_a";
  flags_.server = "127.evil.example:7443";
  EXPECT_THAT(SecurityWarnings(flags_, security),
              ElementsAre(HasSubstr("unencrypted")));
}

TEST_F(ConnectionFlagsTest, PatienceIsADurationWithAUnit) {
  EXPECT_EQ(*ParsePatience(flags_), absl::Seconds(10));
  flags_.patience = "0s";
  EXPECT_EQ(*ParsePatience(flags_), absl::ZeroDuration());
  flags_.patience = "1m30s";
  EXPECT_EQ(*ParsePatience(flags_), absl::Seconds(90));
  for (const char* text : {"", "5", "-1s", "inf", "soon"}) {
    flags_.patience = text;
    EXPECT_THAT(
        ParsePatience(flags_),
        StatusIs(kInvalid, HasSubstr("--patience is '" + std::string(text) +
                                     "', expected")))
        << text;
  }
}

TEST(ConnectionCommandTest, FlagsThatLackAnotherExitWith2) {
  for (const std::vector<std::string>& flags :
       std::vector<std::vector<std::string>>{
           {"--tls-ca", "f"},
           {"--api-key-file", "f"},
           {"--server", "h:1", "--tls-cert", "f", "--tls-key", "f"},
           {"--server", "h:1", "--tls-ca", "f", "--tls-cert", "f"},
           {"--server", "h:1", "--tls-ca", "f", "--tls-key", "f"},
           {"--server", "h:1", "--tls-ca", "/none"},
           {"--server", "h:1", "--api-key-file", "/none"}}) {
    std::vector<std::string> arguments = {"match", "x.off", "y.off"};
    arguments.insert(arguments.end(), flags.begin(), flags.end());
    const CommandOutcome outcome = RunIsomatch(arguments);
    EXPECT_EQ(outcome.status, kExitUsage) << outcome.err;
    EXPECT_THAT(outcome.err, HasSubstr("--"));
  }
}

}  // namespace
}  // namespace isomatch
