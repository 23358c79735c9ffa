#include "server/rpc/channel_arguments.h"

#include <grpcpp/resource_quota.h>

namespace isomatch {
namespace {

/// A MB of gzip is a GiB of zeros, which gRPC would unpack before anybody's key
/// is looked at. Meshes are compressed already, so nothing is unpacked at all,
/// and who sends it is told.
void RefuseCompression(grpc::ServerBuilder& builder) {
  builder.AddChannelArgument(GRPC_ARG_ENABLE_PER_MESSAGE_DECOMPRESSION, 0);
  for (const auto algorithm : {GRPC_COMPRESS_GZIP, GRPC_COMPRESS_DEFLATE}) {
    builder.SetCompressionAlgorithmSupportStatus(algorithm, false);
  }
}

}  // namespace

void SetChannelArguments(const RequestLimits& limits,
                         grpc::ServerBuilder& builder) {
  constexpr int kSecond = 1000;  // milliseconds
  constexpr int kMinute = 60 * kSecond;
  constexpr int kHour = 60 * kMinute;
  builder.SetMaxReceiveMessageSize(static_cast<int>(limits.max_request_bytes));
  RefuseCompression(builder);
  builder.AddChannelArgument(GRPC_ARG_MAX_CONCURRENT_STREAMS, 1000);
  // Who says nothing, or nothing more, gives its connection back; clients
  // connect again by themselves with their next call.
  builder.AddChannelArgument(GRPC_ARG_SERVER_HANDSHAKE_TIMEOUT_MS,
                             20 * kSecond);
  builder.AddChannelArgument(GRPC_ARG_MAX_CONNECTION_IDLE_MS, 5 * kMinute);
  builder.AddChannelArgument(GRPC_ARG_KEEPALIVE_TIME_MS, kMinute);
  builder.AddChannelArgument(GRPC_ARG_KEEPALIVE_TIMEOUT_MS, 20 * kSecond);
  builder.AddChannelArgument(GRPC_ARG_KEEPALIVE_PERMIT_WITHOUT_CALLS, 1);
  builder.AddChannelArgument(
      GRPC_ARG_HTTP2_MIN_RECV_PING_INTERVAL_WITHOUT_DATA_MS, 20 * kSecond);
  builder.AddChannelArgument(GRPC_ARG_MAX_CONNECTION_AGE_MS, kHour);
  builder.AddChannelArgument(GRPC_ARG_MAX_CONNECTION_AGE_GRACE_MS,
                             10 * kMinute);
  grpc::ResourceQuota quota("isomatch");
  quota.Resize(kGrpcBytes);
  builder.SetResourceQuota(quota);
}

}  // namespace isomatch
