#include "server/rpc/grpc_plugins.h"

#include <algorithm>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include <grpcpp/ext/proto_server_reflection_plugin.h>
#include <grpcpp/grpcpp.h>

#include "grpc/health/v1/health.pb.h"

namespace isomatch {
namespace {

class WithoutReflection : public grpc::ServerBuilderOption {
 public:
  using Plugins = std::vector<std::unique_ptr<grpc::ServerBuilderPlugin>>;

  void UpdateArguments(grpc::ChannelArguments*) override {}
  void UpdatePlugins(Plugins* plugins) override {
    const std::string reflection =
        grpc::reflection::ProtoServerReflectionPlugin().name();
    plugins->erase(std::remove_if(plugins->begin(), plugins->end(),
                                  [&](const auto& plugin) {
                                    return plugin->name() == reflection;
                                  }),
                   plugins->end());
  }
};

}  // namespace

void InitGrpcPlugins() {
  static std::once_flag once;
  std::call_once(once, [] {
    // Reflection aborts on the health service unless its descriptor is linked.
    grpc::health::v1::HealthCheckRequest::descriptor();
    grpc::EnableDefaultHealthCheckService(true);
    grpc::reflection::InitProtoReflectionServerBuilderPlugin();
  });
}

void TakeReflection(grpc::ServerBuilder& builder) {
  builder.SetOption(std::make_unique<WithoutReflection>());
}

}  // namespace isomatch
