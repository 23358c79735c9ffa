// CreateJob, GetJob, ListJobs, CancelJob, DeleteJob through a real server.

#include <new>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/server/test_server.h"

namespace isomatch {
namespace {

class JobsTest : public TestServer {
 protected:
  grpc::Status Cancel(const std::string& name, v1::Job* job = nullptr) {
    grpc::ClientContext context;
    v1::CancelJobRequest request;
    request.set_name(name);
    v1::CancelJobResponse response;
    const grpc::Status status = stub_->CancelJob(&context, request, &response);
    if (job != nullptr) *job = response.job();
    return status;
  }

  v1::ListJobsResponse List(const v1::ListJobsRequest& request) {
    grpc::ClientContext context;
    v1::ListJobsResponse response;
    EXPECT_TRUE(stub_->ListJobs(&context, request, &response).ok());
    return response;
  }
};

TEST_F(JobsTest, AJobKeepsWhatItWasGiven) {
  v1::CreateJobRequest request = SphereJob();
  request.set_request_id("r1");
  (*request.mutable_labels())["pose"] = "walk";
  request.mutable_options()->set_random_seed(7);
  request.mutable_options()->set_profile(v1::PROFILE_PAPER);
  const std::string name = CreateJob(request);
  const v1::Job job = Watch(name).back();
  EXPECT_EQ(job.state(), v1::Job::STATE_SUCCEEDED);
  EXPECT_EQ(job.request_id(), "r1");
  EXPECT_EQ(job.labels().at("pose"), "walk");
  EXPECT_EQ(job.result().random_seed(), 7);
  EXPECT_EQ(job.result().profile(), v1::PROFILE_PAPER);
  EXPECT_EQ(job.result().mesh_x().vertices(), 42);
  EXPECT_EQ(job.result().mesh_y().vertices(), 4);
  EXPECT_EQ(job.result().stage_times_size(), 2);
  EXPECT_GT(job.memory_estimate_bytes(), 1 << 20);
  EXPECT_GE(job.end_time().seconds(), job.create_time().seconds());
}

TEST_F(JobsTest, TheSameRequestAgainIsTheSameJob) {
  v1::CreateJobRequest request = SphereJob();
  request.set_request_id("r1");
  const std::string name = CreateJob(request);
  EXPECT_EQ(CreateJob(request), name);
  request.mutable_options()->set_random_seed(9);
  EXPECT_EQ(CreateError(request).reason, "REQUEST_ID_REUSED");
}

TEST_F(JobsTest, ARunningJobIsCancelledAtOnce) {
  gate_open_ = false;
  const std::string name = CreateJob();
  WaitForMatches(1);
  v1::Job job;
  EXPECT_TRUE(Cancel(name, &job).ok());
  EXPECT_EQ(job.state(), v1::Job::STATE_CANCELLED);
  EXPECT_EQ(Watch(name).back().state(), v1::Job::STATE_CANCELLED);
  EXPECT_EQ(ErrorOf(Cancel(name)).reason, "JOB_TERMINAL");
}

TEST_F(JobsTest, AFullQueueIsToldWithARetryDelay) {
  gate_open_ = false;
  ServerConfig config = TestConfig();
  config.max_queued_jobs = 1;
  Restart(config);
  CreateJob();  // runs
  CreateJob();  // waits
  const CallError error = CreateError(SphereJob());
  EXPECT_EQ(error.code, grpc::StatusCode::RESOURCE_EXHAUSTED);
  EXPECT_EQ(error.reason, "QUEUE_FULL");
  EXPECT_TRUE(error.has_retry);
}

TEST_F(JobsTest, TimeoutsFireWhileTheOnlyWorkerIsBusy) {
  gate_open_ = false;
  v1::CreateJobRequest request = SphereJob();
  // The other one has come and gone by then.
  request.mutable_run_timeout()->set_seconds(2);
  const std::string running = CreateJob(request);
  request = SphereJob();
  request.mutable_queue_timeout()->set_nanos(50'000'000);
  const std::string queued = CreateJob(request);
  EXPECT_EQ(Watch(queued).back().error().reason(), "QUEUE_TIMEOUT");
  EXPECT_EQ(Watch(running).back().error().reason(), "RUN_TIMEOUT");
}

TEST_F(JobsTest, ValidateOnlyKeepsNothing) {
  v1::CreateJobRequest request = SphereJob();
  request.set_validate_only(true);
  EXPECT_EQ(CreateJob(request), "");
  EXPECT_EQ(List({}).jobs_size(), 0);
}

TEST_F(JobsTest, AreListedInPagesNewestFirst) {
  const std::string a = CreateJob();
  const std::string b = CreateJob();
  const std::string c = CreateJob();
  v1::ListJobsRequest request;
  request.set_page_size(2);
  const v1::ListJobsResponse first = List(request);
  ASSERT_EQ(first.jobs_size(), 2);
  EXPECT_EQ(first.jobs(0).name(), c);
  EXPECT_EQ(first.jobs(1).name(), b);
  request.set_page_token(first.next_page_token());
  const v1::ListJobsResponse second = List(request);
  ASSERT_EQ(second.jobs_size(), 1);
  EXPECT_EQ(second.jobs(0).name(), a);
  EXPECT_EQ(second.next_page_token(), "");
}

TEST_F(JobsTest, AreListedByLabelInPages) {
  v1::CreateJobRequest job = SphereJob();
  (*job.mutable_labels())["pose"] = "walk";
  const std::string a = CreateJob(job);
  CreateJob();
  const std::string c = CreateJob(job);
  v1::ListJobsRequest request;
  request.set_page_size(1);
  (*request.mutable_labels())["pose"] = "walk";
  v1::ListJobsResponse page = List(request);
  ASSERT_EQ(page.jobs_size(), 1);
  EXPECT_EQ(page.jobs(0).name(), c);
  request.set_page_token(page.next_page_token());
  page = List(request);
  ASSERT_EQ(page.jobs_size(), 1);
  EXPECT_EQ(page.jobs(0).name(), a);
  EXPECT_EQ(page.next_page_token(), "");
  (*request.mutable_labels())["pose"] = "run";
  grpc::ClientContext context;
  EXPECT_EQ(ErrorOf(stub_->ListJobs(&context, request, &page)).field,
            "page_token");
}

TEST_F(JobsTest, AreForgottenWhenDeleted) {
  const std::string name = CreateJob();
  Watch(name);
  v1::DeleteJobRequest request;
  request.set_name(name);
  v1::DeleteJobResponse response;
  grpc::ClientContext context;
  EXPECT_TRUE(stub_->DeleteJob(&context, request, &response).ok());
  grpc::ClientContext again;
  const grpc::Status status = stub_->DeleteJob(&again, request, &response);
  EXPECT_EQ(ErrorOf(status).reason, "JOB_NOT_FOUND");
}

TEST_F(JobsTest, OneTenantHasSoManyPlacesInTheQueue) {
  ServerConfig config = TestConfig();
  config.workers = 1;
  config.max_queued_jobs_per_tenant = 1;
  Restart(config);
  gate_open_ = false;
  CreateJob();
  WaitForMatches(1);
  CreateJob();
  const CallError error = CreateError(SphereJob());
  EXPECT_EQ(error.code, grpc::StatusCode::RESOURCE_EXHAUSTED);
  EXPECT_EQ(error.reason, "TENANT_QUOTA");
  EXPECT_TRUE(error.has_retry);
  gate_open_ = true;
}

TEST_F(JobsTest, OneThatFindsNoMemoryFailsAlone) {
  on_found_ = [](auto&&...) { throw std::bad_alloc(); };
  const v1::Job failed = Watch(CreateJob()).back();
  EXPECT_EQ(failed.state(), v1::Job::STATE_FAILED);
  EXPECT_EQ(failed.error().reason(), "OUT_OF_MEMORY");
  EXPECT_EQ(failed.error().code(), grpc::StatusCode::RESOURCE_EXHAUSTED);
  on_found_ = {};
  EXPECT_EQ(Watch(CreateJob()).back().state(), v1::Job::STATE_SUCCEEDED);
}

TEST_F(JobsTest, ANameThatIsNotOneIsInvalid) {
  EXPECT_EQ(ErrorOf(Cancel("job1")).field, "name");
  const std::string name = CreateJob();
  for (const std::string& after :
       {std::string(1, '\0'), std::string("\0x", 2), std::string("\""),
        std::string("/"), std::string("\x7f"), std::string("é")}) {
    EXPECT_EQ(ErrorOf(Cancel(name + after)).reason, "INVALID_FIELD") << after;
    v1::WatchJobRequest request;
    request.set_name(name + after);
    grpc::ClientContext context;
    v1::WatchJobResponse response;
    const auto reader = stub_->WatchJob(&context, request);
    EXPECT_FALSE(reader->Read(&response)) << after;
    EXPECT_EQ(ErrorOf(reader->Finish()).reason, "INVALID_FIELD") << after;
  }
  EXPECT_EQ(ErrorOf(Cancel("jobs/nobody")).code, grpc::StatusCode::NOT_FOUND);
}

}  // namespace
}  // namespace isomatch
