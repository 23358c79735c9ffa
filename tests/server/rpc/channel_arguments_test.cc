#include "server/rpc/channel_arguments.h"

#include <map>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include <grpcpp/grpcpp.h>
#include <gtest/gtest.h>

namespace isomatch {
namespace {

using Numbers = std::map<std::string, int>;

/// Reads what was set before it.
class ReadArguments : public grpc::ServerBuilderOption {
 public:
  explicit ReadArguments(Numbers* numbers) : numbers_(numbers) {}

  void UpdateArguments(grpc::ChannelArguments* arguments) override {
    const grpc_channel_args all = arguments->c_channel_args();
    for (size_t i = 0; i < all.num_args; ++i) {
      if (all.args[i].type != GRPC_ARG_INTEGER) continue;
      (*numbers_)[all.args[i].key] = all.args[i].value.integer;
    }
  }
  void UpdatePlugins(
      std::vector<std::unique_ptr<grpc::ServerBuilderPlugin>>*) override {}

 private:
  Numbers* numbers_;
};

TEST(ChannelArgumentsTest, APeerThatDoesNothingIsLeft) {
  Numbers numbers;
  grpc::ServerBuilder builder;
  SetChannelArguments({}, builder);
  builder.SetOption(std::make_unique<ReadArguments>(&numbers));
  const auto server = builder.BuildAndStart();
  ASSERT_NE(server, nullptr);
  // One that says nothing, one that began, one that vanished.
  EXPECT_EQ(numbers[GRPC_ARG_SERVER_HANDSHAKE_TIMEOUT_MS], 20'000);
  EXPECT_EQ(numbers[GRPC_ARG_MAX_CONNECTION_IDLE_MS], 300'000);
  EXPECT_EQ(numbers[GRPC_ARG_KEEPALIVE_TIME_MS], 60'000);
  EXPECT_EQ(numbers[GRPC_ARG_KEEPALIVE_TIMEOUT_MS], 20'000);
}

}  // namespace
}  // namespace isomatch
