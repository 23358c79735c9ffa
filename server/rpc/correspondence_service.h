#pragma once

#include "isomatch/v1/service.grpc.pb.h"
#include "server/rpc/raw_message.h"
#include "server/rpc/service_context.h"

namespace isomatch {

using GrpcService = v1::CorrespondenceService;

/// What gRPC calls: every method with the bytes that came, since parsed they
/// may be forty times as many.
using RawMethods = GrpcService::WithRawCallbackMethod_GetServerInfo<
    GrpcService::WithRawCallbackMethod_UploadMesh<
        GrpcService::WithRawCallbackMethod_FindMissingMeshes<
            GrpcService::WithRawCallbackMethod_CreateJob<
                GrpcService::WithRawCallbackMethod_GetJob<
                    GrpcService::WithRawCallbackMethod_WatchJob<
                        GrpcService::WithRawCallbackMethod_ListJobs<
                            GrpcService::WithRawCallbackMethod_CancelJob<
                                GrpcService::WithRawCallbackMethod_DeleteJob<
                                    GrpcService::
                                        WithRawCallbackMethod_DownloadResult<
                                            GrpcService::Service>>>>>>>>>>;

/// The RPCs of isomatch.v1: each asks who calls, looks how large its request
/// would be, parses it and forgets its bytes, asks the manager, converts the
/// answer. Those with a life of their own are in files of their names. What
/// reads or writes the disk does so in other threads than gRPC's, which are
/// few.
class CorrespondenceService final : public RawMethods {
 public:
  explicit CorrespondenceService(const ServiceContext& context)
      : context_(context) {}

  using Context = grpc::CallbackServerContext;
  using Bytes = grpc::ByteBuffer;
  using Unary = grpc::ServerUnaryReactor;
  using Reader = grpc::ServerReadReactor<Bytes>;
  using Writer = grpc::ServerWriteReactor<Bytes>;

  Unary* GetServerInfo(Context* call, const Bytes* request,
                       Bytes* response) override;
  Reader* UploadMesh(Context* call, Bytes* response) override;
  Unary* FindMissingMeshes(Context* call, const Bytes* request,
                           Bytes* response) override;
  Unary* CreateJob(Context* call, const Bytes* request,
                   Bytes* response) override;
  Unary* GetJob(Context* call, const Bytes* request, Bytes* response) override;
  Writer* WatchJob(Context* call, const Bytes* request) override;
  Unary* ListJobs(Context* call, const Bytes* request,
                  Bytes* response) override;
  Unary* CancelJob(Context* call, const Bytes* request,
                   Bytes* response) override;
  Unary* DeleteJob(Context* call, const Bytes* request,
                   Bytes* response) override;
  Writer* DownloadResult(Context* call, const Bytes* request) override;

 private:
  /// What a call must be to be answered.
  struct Admitted {
    /// The least that the caller may do.
    Role role;
    RawBounds request;
  };

  /// Returns who calls and parses the request; an error when the caller may not
  /// or the request is too large. Its bytes are gone then.
  absl::StatusOr<Caller> Read(const Context& call, const Admitted& admitted,
                              const Bytes* raw,
                              google::protobuf::Message& request) const;

  /// What answers a call: fills in its response.
  template <typename Request, typename Response>
  using Answer = absl::Status (*)(const ServiceContext&, const Caller&,
                                  const Request&, Response&);

  /// Ends the call with what `answer` returns.
  template <typename Request, typename Response>
  Unary* Respond(Context* call, const Admitted& admitted, const Bytes* raw,
                 Bytes* response, Answer<Request, Response> answer);

  /// The same for what changes a job, when it is the tenant's turn.
  template <typename Request, typename Response>
  Unary* RespondInTurn(Context* call, const Admitted& admitted,
                       const Bytes* raw, Bytes* response,
                       Answer<Request, Response> answer);

  /// A call, and who calls.
  struct Asked {
    Context* call;
    const Caller& caller;
  };

  /// Has `turns` end the call; at once when too many of the tenant wait there.
  template <typename Request, typename Response>
  Unary* Post(TenantTurns& turns, const Asked& asked, const Request& request,
              Bytes* response, Answer<Request, Response> answer);

  const ServiceContext context_;
};

}  // namespace isomatch
