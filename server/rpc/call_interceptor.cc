#include "server/rpc/call_interceptor.h"

#include <map>
#include <utility>

#include <google/protobuf/descriptor.h>
#include <google/protobuf/message.h>
#include <grpcpp/server_context.h>

#include "absl/status/status.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "isomatch/v1/service.pb.h"
#include "server/convert/job_name.h"
#include "server/logging/log.h"
#include "server/rpc/raw_message.h"
#include "server/rpc/security/call_metadata.h"

namespace isomatch {
namespace {

using grpc::experimental::InterceptionHookPoints;
using grpc::experimental::InterceptorBatchMethods;
using grpc::experimental::ServerRpcInfo;

/// Bytes of an error message that are logged: some messages quote what the
/// client sent.
constexpr size_t kMaxErrorBytes = 300;

/// Reads a job's id from a message whose type the method tells; "" for none.
using JobOf = std::string (*)(const void* message);

template <typename Request>
std::string JobOfRequest(const void* message) {
  Request request;
  const auto& raw = *static_cast<const grpc::ByteBuffer*>(message);
  if (!ParseWithin(kSmallRequest, raw, request).ok()) return "";
  const auto id = ParseJobName(request.name());
  return id.ok() ? *id : "";
}

std::string JobOfCreate(const void* message) {
  v1::CreateJobResponse response;
  if (!ParseRaw(*static_cast<const grpc::ByteBuffer*>(message), response)) {
    return "";
  }
  const auto id = ParseJobName(response.job().name());
  return id.ok() ? *id : "";
}

/// For methods that nobody serves, so that a client cannot make labels.
constexpr char kOtherMethod[] = "other";

/// How calls of one method are told apart from those of others.
struct Method {
  /// "package.Service/Method".
  std::string name = kOtherMethod;
  JobOf job_of_request = nullptr;
  JobOf job_of_response = nullptr;
  /// gRPC parses requests itself and keeps the last one while the stream lives.
  bool is_parsed_by_grpc = false;
};

/// For a message that came of a method that gRPC parses: what is too large is
/// no request any more.
void ClearIfLarge(void* message) {
  auto* const request = static_cast<google::protobuf::Message*>(message);
  if (request != nullptr && request->ByteSizeLong() > kSmallRequest.max_bytes) {
    request->Clear();
  }
}

/// Methods by gRPC's path, which is "/" and the name.
using Methods = std::map<std::string, Method>;

void AddService(const char* name, Methods& methods) {
  const auto* const service =
      google::protobuf::DescriptorPool::generated_pool()->FindServiceByName(
          name);
  if (service == nullptr) return;  // this server does not have it
  for (int i = 0; i < service->method_count(); ++i) {
    const std::string method =
        absl::StrCat(name, "/", service->method(i)->name());
    methods[absl::StrCat("/", method)].name = method;
  }
}

Methods KnownMethods() {
  Methods methods;
  AddService("isomatch.v1.CorrespondenceService", methods);
  AddService("grpc.health.v1.Health", methods);
  AddService("grpc.reflection.v1alpha.ServerReflection", methods);
  const auto reflection = methods.find(
      "/grpc.reflection.v1alpha.ServerReflection/ServerReflectionInfo");
  if (reflection != methods.end()) reflection->second.is_parsed_by_grpc = true;
  const auto of = [&](const char* name) -> Method& {
    return methods[absl::StrCat("/isomatch.v1.CorrespondenceService/", name)];
  };
  of("CreateJob").job_of_response = JobOfCreate;
  of("GetJob").job_of_request = JobOfRequest<v1::GetJobRequest>;
  of("WatchJob").job_of_request = JobOfRequest<v1::WatchJobRequest>;
  of("CancelJob").job_of_request = JobOfRequest<v1::CancelJobRequest>;
  of("DeleteJob").job_of_request = JobOfRequest<v1::DeleteJobRequest>;
  of("DownloadResult").job_of_request = JobOfRequest<v1::DownloadResultRequest>;
  return methods;
}

/// One call. gRPC calls it at the hooks below, in the order of the life of the
/// call; the only ones that may come at the same time are those of messages of
/// a stream, and from those nothing is read.
class CallInterceptor final : public grpc::experimental::Interceptor {
 public:
  CallInterceptor(const CallObservation& observation, const Method& method,
                  ServerRpcInfo& call)
      : observation_(observation),
        method_(method),
        call_(call),
        begin_(observation.now()) {}

  void Intercept(InterceptorBatchMethods* batch) override {
    const auto at = [&](InterceptionHookPoints hook) {
      return batch->QueryInterceptionHookPoint(hook);
    };
    if (at(InterceptionHookPoints::POST_RECV_INITIAL_METADATA)) {
      ReadMetadata(batch->GetRecvInitialMetadata());
    }
    if (at(InterceptionHookPoints::POST_RECV_MESSAGE)) {
      if (method_.is_parsed_by_grpc) ClearIfLarge(batch->GetRecvMessage());
      ReadJob(method_.job_of_request, batch->GetRecvMessage());
    }
    if (at(InterceptionHookPoints::PRE_SEND_INITIAL_METADATA)) {
      batch->GetSendInitialMetadata()->emplace(kRequestIdKey, request_id_);
    }
    if (at(InterceptionHookPoints::PRE_SEND_MESSAGE) &&
        method_.job_of_response != nullptr) {
      ReadJob(method_.job_of_response, batch->GetSendMessage());
    }
    if (at(InterceptionHookPoints::PRE_SEND_STATUS)) {
      Finish(batch->GetSendStatus());
    }
    batch->Proceed();
  }

 private:
  void ReadMetadata(CallMetadata* metadata) {
    request_id_ = CallIdOf(*metadata);
    if (request_id_.empty()) request_id_ = observation_.new_id();
    traceparent_ = TraceParentOf(*metadata);
    // The handler reads it there while this, which holds the text, lives.
    metadata->erase(kRequestIdKey);
    metadata->emplace(kRequestIdKey, request_id_);
  }

  void ReadJob(JobOf job_of, const void* message) {
    if (job_of != nullptr && message != nullptr) job_ = job_of(message);
  }

  void Finish(const grpc::Status& status) {
    const absl::Duration handled = observation_.now() - begin_;
    const std::string code = absl::StatusCodeToString(
        static_cast<absl::StatusCode>(status.error_code()));
    observation_.metrics->CallHandled(method_.name, code, handled);
    const LogLevel level = status.ok() ? LogLevel::kDebug : LogLevel::kInfo;
    if (!observation_.log || !ShouldLog(level)) return;
    const std::string error = ErrorOf(status);
    Log(level, Describe(code, handled, error), Fields(code, handled, error));
  }

  std::string ErrorOf(const grpc::Status& status) const {
    // gRPC's answer when the client cancelled at once, or sent too many bytes
    // or no message of the method.
    if (status.error_code() == grpc::StatusCode::UNIMPLEMENTED &&
        method_.name != kOtherMethod) {
      return "no readable request came";
    }
    return status.error_message().substr(0, kMaxErrorBytes);
  }

  std::string Describe(const std::string& code, absl::Duration handled,
                       const std::string& error) const {
    std::string text =
        absl::StrFormat("rpc %s %s after %.4f s, request %s, peer %s",
                        method_.name, code, absl::ToDoubleSeconds(handled),
                        request_id_, call_.server_context()->peer());
    if (!job_.empty()) absl::StrAppend(&text, ", job ", job_);
    if (!traceparent_.empty()) absl::StrAppend(&text, ", trace ", traceparent_);
    if (!error.empty()) absl::StrAppend(&text, ": ", error);
    return text;
  }

  LogFields Fields(const std::string& code, absl::Duration handled,
                   const std::string& error) const {
    LogFields fields = {{"method", method_.name},
                        {"code", code},
                        {"seconds", absl::ToDoubleSeconds(handled)},
                        {"request_id", request_id_},
                        {"peer", call_.server_context()->peer()}};
    if (!job_.empty()) fields.push_back({"job", job_});
    if (!traceparent_.empty()) fields.push_back({"traceparent", traceparent_});
    if (!error.empty()) fields.push_back({"error", error});
    return fields;
  }

  const CallObservation& observation_;
  const Method& method_;
  ServerRpcInfo& call_;
  const absl::Time begin_;
  std::string request_id_;
  std::string traceparent_;
  std::string job_;
};

class CallInterceptors final
    : public grpc::experimental::ServerInterceptorFactoryInterface {
 public:
  explicit CallInterceptors(CallObservation observation)
      : observation_(std::move(observation)) {}

  grpc::experimental::Interceptor* CreateServerInterceptor(
      ServerRpcInfo* call) override {
    const auto known = methods_.find(call->method());
    return new CallInterceptor(
        observation_, known == methods_.end() ? other_ : known->second, *call);
  }

 private:
  const CallObservation observation_;
  const Methods methods_ = KnownMethods();
  const Method other_;
};

}  // namespace

std::unique_ptr<grpc::experimental::ServerInterceptorFactoryInterface>
MakeCallInterceptors(CallObservation observation) {
  return std::make_unique<CallInterceptors>(std::move(observation));
}

}  // namespace isomatch
