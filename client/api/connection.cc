#include "client/api/connection.h"

#include <cassert>
#include <utility>
#include <vector>

#include <grpcpp/create_channel.h>
#include <grpcpp/security/credentials.h>
#include <grpcpp/support/channel_arguments.h>
#include <grpcpp/support/client_interceptor.h>

#include "absl/algorithm/container.h"
#include "absl/strings/ascii.h"
#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"

namespace isomatch {
namespace {

using grpc::experimental::ClientInterceptorFactoryInterface;
using grpc::experimental::ClientRpcInfo;
using grpc::experimental::InterceptionHookPoints;
using grpc::experimental::Interceptor;
using grpc::experimental::InterceptorBatchMethods;

// Gives a call the key. (gRPC's own call credentials refuse to work without
// TLS, which a proxy in front or a loopback address does not need.)
class ApiKeyInterceptor final : public Interceptor {
 public:
  explicit ApiKeyInterceptor(const std::string& key) : key_(key) {}

  void Intercept(InterceptorBatchMethods* methods) override {
    if (methods->QueryInterceptionHookPoint(
            InterceptionHookPoints::PRE_SEND_INITIAL_METADATA)) {
      methods->GetSendInitialMetadata()->emplace("authorization",
                                                 absl::StrCat("Bearer ", key_));
    }
    methods->Proceed();
  }

 private:
  const std::string& key_;
};

class ApiKeyInterceptorFactory final
    : public ClientInterceptorFactoryInterface {
 public:
  explicit ApiKeyInterceptorFactory(std::string key) : key_(std::move(key)) {}

  Interceptor* CreateClientInterceptor(ClientRpcInfo*) override {
    return new ApiKeyInterceptor(key_);
  }

 private:
  const std::string key_;
};

grpc::ChannelArguments MakeArguments() {
  constexpr int kSecond = 1000;  // milliseconds
  grpc::ChannelArguments arguments;
  arguments.SetInt(GRPC_ARG_INITIAL_RECONNECT_BACKOFF_MS, kSecond / 4);
  arguments.SetInt(GRPC_ARG_MAX_RECONNECT_BACKOFF_MS, kSecond);
  arguments.SetInt(GRPC_ARG_MIN_RECONNECT_BACKOFF_MS, 5 * kSecond);
  // Servers allow a ping every 20 s, and a watch sends nothing else.
  arguments.SetInt(GRPC_ARG_KEEPALIVE_TIME_MS, 25 * kSecond);
  arguments.SetInt(GRPC_ARG_KEEPALIVE_TIMEOUT_MS, 10 * kSecond);
  arguments.SetInt(GRPC_ARG_HTTP2_MAX_PINGS_WITHOUT_DATA, 0);
  return arguments;
}

}  // namespace

bool IsApiKeyText(const std::string& text) {
  constexpr std::size_t kMostCharacters = 1024;
  return !text.empty() && text.size() <= kMostCharacters &&
         absl::c_all_of(text, [](char c) {
           return absl::ascii_isgraph(static_cast<unsigned char>(c));
         });
}

std::shared_ptr<grpc::Channel> ConnectTo(const std::string& address,
                                         const ConnectionSecurity& security) {
  const bool are_several = absl::StrContains(address, ",");
  const std::string target =
      are_several ? absl::StrCat("ipv4:", address) : address;
  grpc::ChannelArguments arguments = MakeArguments();
  if (are_several) {  // else it is asked for by the name of the whole list
    arguments.SetString(GRPC_ARG_DEFAULT_AUTHORITY,
                        address.substr(0, address.find(',')));
  }
  const auto credentials =
      security.ca_pem.empty()
          ? grpc::InsecureChannelCredentials()
          : grpc::SslCredentials(
                {security.ca_pem, security.key_pem, security.certificate_pem});
  if (security.api_key.empty()) {
    return grpc::CreateCustomChannel(target, credentials, arguments);
  }
  assert(IsApiKeyText(security.api_key));
  std::vector<std::unique_ptr<ClientInterceptorFactoryInterface>> interceptors;
  interceptors.push_back(
      std::make_unique<ApiKeyInterceptorFactory>(security.api_key));
  return grpc::experimental::CreateCustomChannelWithInterceptors(
      target, credentials, arguments, std::move(interceptors));
}

}  // namespace isomatch
