#pragma once

#include <memory>
#include <string>
#include <utility>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <pqxx/pqxx>

#include "absl/time/clock.h"
#include "server/server.h"
#include "server/shared_stores.h"
#include "tests/server/postgres/test_database.h"
#include "tests/server/test_server.h"
#include "tests/support/matchers.h"

namespace isomatch {

/// The fixture's own server is the first gateway; there is no worker at first.
class ClusterTest : public TestServer {
 protected:
  void SetUp() override {
    ASSERT_THAT(NewDatabase(), IsOk());  // its tables stay
    server_ = Start(Config("gateway"));
    channel_ = grpc::CreateChannel(server_->address(),
                                   grpc::InsecureChannelCredentials());
    stub_ = v1::CorrespondenceService::NewStub(channel_);
  }

  static ServerConfig Config(const std::string& role) {
    ServerConfig config = TestConfig();
    config.store = (*TheServer())->url();
    config.role = role;
    config.log_level = "off";
    config.lease = absl::Seconds(2);
    config.unwatched_grace = absl::Milliseconds(500);
    config.unresponsive_grace = absl::Seconds(1);
    if (role == "worker") config.listen = "";
    return config;
  }

  std::unique_ptr<Server> Start(const ServerConfig& config) {
    auto created =
        Server::Create(config, GatedEngine(), nullptr, OpenAnyStores);
    EXPECT_THAT(created, IsOk());
    return created.ok() ? *std::move(created) : nullptr;
  }

  /// The fixture's calls go to this gateway from now on.
  void CallAt(const Server& gateway) {
    channel_ = grpc::CreateChannel(gateway.address(),
                                   grpc::InsecureChannelCredentials());
    stub_ = v1::CorrespondenceService::NewStub(channel_);
  }

  v1::Job WaitFor(const std::string& name, v1::Job::State state) {
    v1::Job job = GetJob(name);
    for (int i = 0; i < 1000 && job.state() != state; ++i) {
      absl::SleepFor(absl::Milliseconds(20));
      job = GetJob(name);
    }
    EXPECT_EQ(job.state(), state) << job.ShortDebugString();
    return job;
  }

  v1::Job Cancel(const std::string& name) {
    grpc::ClientContext context;
    v1::CancelJobRequest request;
    request.set_name(name);
    v1::CancelJobResponse response;
    EXPECT_TRUE(stub_->CancelJob(&context, request, &response).ok());
    return response.job();
  }

  grpc::Status Delete(const std::string& name) {
    grpc::ClientContext context;
    v1::DeleteJobRequest request;
    request.set_name(name);
    v1::DeleteJobResponse response;
    return stub_->DeleteJob(&context, request, &response);
  }

  static void Do(const std::string& sql) {
    pqxx::connection database((*TheServer())->url());
    pqxx::work work(database);
    work.exec(sql);
    work.commit();
  }

  v1::GetServerInfoResponse Info() {
    grpc::ClientContext context;
    v1::GetServerInfoResponse info;
    EXPECT_TRUE(stub_->GetServerInfo(&context, {}, &info).ok());
    return info;
  }
};

}  // namespace isomatch
