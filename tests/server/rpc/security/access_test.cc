#include "server/rpc/security/access.h"

#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "absl/strings/str_cat.h"
#include "core/base/sha256.h"
#include "server/jobs/errors.h"
#include "tests/support/matchers.h"
#include "tests/support/temporary_folder.h"

namespace isomatch {
namespace {

constexpr Role kRoles[] = {Role::kRead, Role::kSubmit, Role::kAdmin};

class AccessTest : public testing::Test {
 protected:
  AccessTest() {
    std::string text;
    for (const Role role : kRoles) {
      const std::string name = RoleName(role);
      absl::StrAppend(&text, name, " lab ", name, " ", Sha256Hex(name), "\n");
    }
    auto keys = ApiKeys::Open(folder_.Write("keys", text),
                              [] { return absl::UnixEpoch(); }, {});
    EXPECT_THAT(keys, IsOk());
    access_ = std::make_unique<Access>(*std::move(keys));
  }

  std::string ReasonFor(const CallMetadata& metadata) const {
    return DetailsOf(access_->IdentifyBy(metadata, Role::kRead).status())
        .reason;
  }

  TemporaryFolder folder_;
  std::unique_ptr<Access> access_;
};

TEST_F(AccessTest, ARoleMayWhatThoseBeforeItMay) {
  for (const Role has : kRoles) {
    for (const Role needs : kRoles) {
      const std::string key = RoleName(has);
      const auto caller = access_->IdentifyBy({{"api-key", key}}, needs);
      EXPECT_EQ(caller.ok(), has >= needs) << key << " " << RoleName(needs);
      if (caller.ok()) {
        EXPECT_EQ(caller->tenant, "lab");
        EXPECT_EQ(caller->role, has);
      } else {
        EXPECT_EQ(DetailsOf(caller.status()).reason, "ROLE_TOO_LOW");
      }
    }
  }
}

TEST_F(AccessTest, TheKeyIsFoundInEitherPlace) {
  for (const CallMetadata& metadata : {
           CallMetadata{{"authorization", "Bearer read"}},
           CallMetadata{{"authorization", "bearer  read "}},
           CallMetadata{{"api-key", "read"}},
           // As a proxy may add one of its own.
           CallMetadata{{"api-key", "read"}, {"authorization", "Basic x"}},
       }) {
    EXPECT_THAT(access_->IdentifyBy(metadata, Role::kRead), IsOk());
  }
}

TEST_F(AccessTest, NoKeyAndAWrongKeyAreToldApart) {
  EXPECT_EQ(ReasonFor({}), "API_KEY_MISSING");
  EXPECT_EQ(ReasonFor({{"api-key", ""}}), "API_KEY_MISSING");
  EXPECT_EQ(ReasonFor({{"authorization", "Bearer "}}), "API_KEY_MISSING");
  EXPECT_EQ(ReasonFor({{"authorization", "Basic read"}}), "API_KEY_MISSING");
  EXPECT_EQ(ReasonFor({{"api-key", "rea"}}), "API_KEY_WRONG");
  EXPECT_EQ(ReasonFor({{"authorization", "Bearer readx"}}), "API_KEY_WRONG");
  EXPECT_EQ(ReasonFor({{"api-key", Sha256Hex("read")}}), "API_KEY_WRONG");
}

TEST_F(AccessTest, WithoutKeysEverybodyIsTheDefault) {
  const auto caller = Access(nullptr).IdentifyBy({}, Role::kAdmin);
  ASSERT_THAT(caller, IsOk());
  EXPECT_EQ(caller->tenant, "default");
}

TEST(RoleTest, NamesAndRolesBelongTogether) {
  for (const Role role : kRoles) EXPECT_EQ(ParseRole(RoleName(role)), role);
  EXPECT_EQ(ParseRole("root"), std::nullopt);
  EXPECT_EQ(ParseRole(""), std::nullopt);
}

TEST(TenantNameTest, HasAFewSafeCharacters) {
  EXPECT_TRUE(IsTenantName("a"));
  EXPECT_TRUE(IsTenantName("lab-2_b"));
  EXPECT_TRUE(IsTenantName(std::string(63, 'x')));
  for (const std::string& name :
       {std::string(), std::string(64, 'x'), std::string("Lab"),
        std::string("a b"), std::string("../x"), std::string("a\0", 2)}) {
    EXPECT_FALSE(IsTenantName(name)) << name;
  }
}

}  // namespace
}  // namespace isomatch
