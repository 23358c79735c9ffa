#pragma once

#include "isomatch/v1/service.grpc.pb.h"
#include "server/rpc/service_context.h"

namespace isomatch {

using GrpcService = v1::CorrespondenceService;

/// What gRPC calls: CreateJob and FindMissingMeshes with the bytes that came,
/// the others with parsed messages.
using CallbackMethods = GrpcService::WithCallbackMethod_GetServerInfo<
    GrpcService::WithCallbackMethod_UploadMesh<
        GrpcService::WithRawCallbackMethod_FindMissingMeshes<
            GrpcService::WithRawCallbackMethod_CreateJob<
                GrpcService::WithCallbackMethod_GetJob<
                    GrpcService::WithCallbackMethod_WatchJob<
                        GrpcService::WithCallbackMethod_ListJobs<
                            GrpcService::WithCallbackMethod_CancelJob<
                                GrpcService::WithCallbackMethod_DeleteJob<
                                    GrpcService::
                                        WithCallbackMethod_DownloadResult<
                                            GrpcService::Service>>>>>>>>>>;

/// The RPCs of isomatch.v1: each asks who calls, parses its request, asks the
/// manager, converts the answer. Those with a life of their own are in files of
/// their names. Requests that may hold many messages are not parsed by gRPC:
/// their fields are counted first.
class CorrespondenceService final : public CallbackMethods {
 public:
  explicit CorrespondenceService(const ServiceContext& context)
      : context_(context) {}

  grpc::ServerUnaryReactor* GetServerInfo(
      grpc::CallbackServerContext* call, const v1::GetServerInfoRequest*,
      v1::GetServerInfoResponse* response) override;
  grpc::ServerReadReactor<v1::UploadMeshRequest>* UploadMesh(
      grpc::CallbackServerContext* call,
      v1::UploadMeshResponse* response) override;
  grpc::ServerUnaryReactor* FindMissingMeshes(
      grpc::CallbackServerContext* call, const grpc::ByteBuffer* request,
      grpc::ByteBuffer* response) override;
  grpc::ServerUnaryReactor* CreateJob(grpc::CallbackServerContext* call,
                                      const grpc::ByteBuffer* request,
                                      grpc::ByteBuffer* response) override;
  grpc::ServerUnaryReactor* GetJob(grpc::CallbackServerContext* call,
                                   const v1::GetJobRequest* request,
                                   v1::GetJobResponse* response) override;
  grpc::ServerWriteReactor<v1::WatchJobResponse>* WatchJob(
      grpc::CallbackServerContext* call,
      const v1::WatchJobRequest* request) override;
  grpc::ServerUnaryReactor* ListJobs(grpc::CallbackServerContext* call,
                                     const v1::ListJobsRequest* request,
                                     v1::ListJobsResponse* response) override;
  grpc::ServerUnaryReactor* CancelJob(grpc::CallbackServerContext* call,
                                      const v1::CancelJobRequest* request,
                                      v1::CancelJobResponse* response) override;
  grpc::ServerUnaryReactor* DeleteJob(grpc::CallbackServerContext* call,
                                      const v1::DeleteJobRequest* request,
                                      v1::DeleteJobResponse* response) override;
  grpc::ServerWriteReactor<v1::DownloadResultResponse>* DownloadResult(
      grpc::CallbackServerContext* call,
      const v1::DownloadResultRequest* request) override;

 private:
  /// Ends the call with what `answer`, a function of the Caller, returns; with
  /// an error when the caller may not.
  template <typename Answer>
  grpc::ServerUnaryReactor* Respond(grpc::CallbackServerContext* call,
                                    Role needed, const Answer& answer);

  const ServiceContext context_;
};

}  // namespace isomatch
