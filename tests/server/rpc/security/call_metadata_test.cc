#include "server/rpc/security/call_metadata.h"

#include <string>

#include <gtest/gtest.h>

namespace isomatch {
namespace {

std::string Found(const std::string& sent) {
  return TraceParentOf({{"traceparent", sent}});
}

TEST(TraceParentTest, ARightOneIsTakenAsItIs) {
  for (const char* sent :
       {"00-0af7651916cd43dd8448eb211c80319c-b7ad6b7169203331-01",
        "00-0af7651916cd43dd8448eb211c80319c-b7ad6b7169203331-00",
        "00-00000000000000000000000000000001-0000000000000001-ff"}) {
    EXPECT_EQ(Found(sent), sent);
  }
  EXPECT_EQ(TraceParentOf({}), "");
}

TEST(TraceParentTest, WrongOnesAreIgnored) {
  for (const char* sent :
       {"", "00", "00-1-2-3",
        // Upper case, and what is no digit.
        "00-0AF7651916cd43dd8448eb211c80319c-b7ad6b7169203331-01",
        "00-0af7651916cd43dd8448eb211c80319g-b7ad6b7169203331-01",
        "00-0af7651916cd43dd8448eb211c80319c-b7ad6b7169203331-0x",
        // All zero.
        "00-00000000000000000000000000000000-b7ad6b7169203331-01",
        "00-0af7651916cd43dd8448eb211c80319c-0000000000000000-01",
        // Another version, more fields, other lengths.
        "01-0af7651916cd43dd8448eb211c80319c-b7ad6b7169203331-01",
        "ff-0af7651916cd43dd8448eb211c80319c-b7ad6b7169203331-01",
        "00-0af7651916cd43dd8448eb211c80319c-b7ad6b7169203331-01-x",
        "00-0af7651916cd43dd8448eb211c80319-cb7ad6b7169203331-01",
        "00-0af7651916cd43dd8448eb211c80319c-b7ad6b7169203331-1",
        " 00-0af7651916cd43dd8448eb211c80319c-b7ad6b7169203331-01"}) {
    EXPECT_EQ(Found(sent), "") << sent;
  }
}

}  // namespace
}  // namespace isomatch
