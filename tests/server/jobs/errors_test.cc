#include "server/jobs/errors.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/support/matchers.h"

namespace isomatch {
namespace {

using testing::HasSubstr;
using testing::Pair;
using testing::UnorderedElementsAre;

TEST(ErrorsTest, CarryReasonFieldAndEveryNumberOfTheMessage) {
  const absl::Status status = MatchOutOfRange("landmarks[3].x", 99, 42);
  EXPECT_THAT(status, StatusIs(absl::StatusCode::kInvalidArgument,
                               HasSubstr("landmarks[3].x: 99")));
  const ErrorDetails details = DetailsOf(status);
  EXPECT_EQ(details.reason, "MATCH_OUT_OF_RANGE");
  EXPECT_EQ(details.field, "landmarks[3].x");
  EXPECT_FALSE(details.retry_after);
  EXPECT_THAT(details.metadata, UnorderedElementsAre(Pair("value", "99"),
                                                     Pair("vertices", "42")));
}

TEST(ErrorsTest, AnOffsetBeyondWhatIsThereNamesBoth) {
  const absl::Status status = UploadOffsetBeyond(9, 4);
  EXPECT_THAT(status, StatusIs(absl::StatusCode::kInvalidArgument,
                               HasSubstr("offset: 9, expected at most the 4")));
  const ErrorDetails details = DetailsOf(status);
  EXPECT_EQ(details.reason, "UPLOAD_MALFORMED");
  EXPECT_EQ(details.field, "offset");
  EXPECT_THAT(
      details.metadata,
      UnorderedElementsAre(Pair("offset", "9"), Pair("received_bytes", "4")));
}

TEST(ErrorsTest, OnesThatPassTellWhenToTryAgain) {
  EXPECT_EQ(DetailsOf(QueueFull(7, absl::Seconds(5))).retry_after,
            absl::Seconds(5));
  EXPECT_TRUE(DetailsOf(OutOfMemory()).retry_after);
  EXPECT_EQ(DetailsOf(Draining(absl::Milliseconds(1500))).retry_after,
            absl::Milliseconds(1500));
}

TEST(ErrorsTest, ThoseOfAccessTellWhatIsMissing) {
  EXPECT_THAT(ApiKeyMissing(), StatusIs(absl::StatusCode::kUnauthenticated,
                                        HasSubstr("authorization: Bearer")));
  EXPECT_EQ(DetailsOf(ApiKeyMissing()).reason, "API_KEY_MISSING");
  EXPECT_EQ(ApiKeyWrong().code(), absl::StatusCode::kUnauthenticated);
  EXPECT_EQ(DetailsOf(ApiKeyWrong()).reason, "API_KEY_WRONG");
  const absl::Status low = RoleTooLow(Role::kRead, Role::kSubmit);
  EXPECT_THAT(low,
              StatusIs(absl::StatusCode::kPermissionDenied,
                       HasSubstr("the role read, this call needs submit")));
  EXPECT_EQ(DetailsOf(low).reason, "ROLE_TOO_LOW");
  EXPECT_THAT(
      DetailsOf(low).metadata,
      UnorderedElementsAre(Pair("role", "read"), Pair("needed", "submit")));
}

TEST(ErrorsTest, OthersErrorsHaveTheirCodeAsReason) {
  EXPECT_EQ(DetailsOf(absl::InternalError("x")).reason, "INTERNAL");
}

TEST(ErrorsTest, TheFieldIsNotRepeatedInFrontOfCoresMessages) {
  EXPECT_EQ(
      MeshMalformed("mesh_x.faces[3]", "mesh_x.faces[3] is odd").message(),
      "mesh_x.faces[3] is odd");
}

TEST(ErrorsTest, ThePathAtTheHeadOfAMessageIsFound) {
  EXPECT_EQ(LeadingFieldPath("mesh_x.faces[3]: bad", "mesh_x"),
            "mesh_x.faces[3]");
  EXPECT_EQ(LeadingFieldPath("something else", "mesh_x"), "mesh_x");
}

}  // namespace
}  // namespace isomatch
