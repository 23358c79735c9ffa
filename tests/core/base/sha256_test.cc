#include "core/base/sha256.h"

#include <gtest/gtest.h>

namespace isomatch {
namespace {

TEST(Sha256Test, GivesTheDigestOfTheStandardsExample) {
  // FIPS 180-4, example "abc".
  EXPECT_EQ(Sha256Hex("abc"),
            "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad");
}

TEST(Sha256Test, PiecesGiveTheDigestOfTheWhole) {
  Sha256 sha256;
  sha256.Update("ab");
  sha256.Update("");
  sha256.Update("c");
  EXPECT_EQ(sha256.HexDigest(), Sha256Hex("abc"));
}

TEST(Sha256Test, OnlySixtyFourLowerCaseDigitsAreADigest) {
  const std::string digest = Sha256Hex("abc");
  EXPECT_TRUE(IsSha256Hex(digest));
  EXPECT_FALSE(IsSha256Hex(digest + "0"));
  EXPECT_FALSE(IsSha256Hex(digest.substr(1)));
  EXPECT_FALSE(IsSha256Hex("B" + digest.substr(1)));
  EXPECT_FALSE(IsSha256Hex("g" + digest.substr(1)));
}

}  // namespace
}  // namespace isomatch
