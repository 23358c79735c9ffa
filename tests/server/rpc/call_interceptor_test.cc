// Request ids and the log of calls, of a whole server.

#include "server/rpc/call_interceptor.h"

#include <map>
#include <string>
#include <utility>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "absl/strings/str_cat.h"
#include "tests/server/logging/captured_log.h"
#include "tests/server/test_server.h"

namespace isomatch {
namespace {

using nlohmann::json;
using testing::HasSubstr;
using testing::Not;

constexpr char kTraceparent[] =
    "00-0af7651916cd43dd8448eb211c80319c-b7ad6b7169203331-01";
constexpr char kService[] = "isomatch.v1.CorrespondenceService/";

class CallInterceptorTest : public TestServer {
 protected:
  /// Calls GetServerInfo with these metadata; returns the request ids that
  /// come back.
  std::vector<std::string> RequestIds(
      const std::vector<std::pair<std::string, std::string>>& metadata) {
    grpc::ClientContext context;
    for (const auto& [key, value] : metadata) context.AddMetadata(key, value);
    v1::GetServerInfoResponse response;
    EXPECT_TRUE(stub_->GetServerInfo(&context, {}, &response).ok());
    return Returned(context);
  }

  static std::vector<std::string> Returned(const grpc::ClientContext& context) {
    std::vector<std::string> ids;
    const auto& metadata = context.GetServerInitialMetadata();
    const auto [begin, end] = metadata.equal_range("x-request-id");
    for (auto entry = begin; entry != end; ++entry) {
      ids.emplace_back(entry->second.data(), entry->second.size());
    }
    return ids;
  }

  /// The server must not log any more: stops it.
  std::vector<json> LinesOf(const std::string& method) {
    server_->Shutdown(absl::ZeroDuration());
    std::vector<json> lines;
    for (const json& line : log_.lines()) {
      if (line.value("method", "") == method) lines.push_back(line);
    }
    return lines;
  }

  CapturedLog log_{LogFormat::kJson};
};

TEST_F(CallInterceptorTest, AGoodRequestIdComesBack) {
  const std::string longest(128, 'x');
  for (const std::string& id : {std::string("Abc-1.2_3"), longest}) {
    EXPECT_THAT(RequestIds({{"x-request-id", id}}), testing::ElementsAre(id));
  }
}

TEST_F(CallInterceptorTest, OtherwiseTheServerMakesOne) {
  const auto first = RequestIds({});
  const auto second = RequestIds({});
  ASSERT_EQ(first.size(), 1);
  EXPECT_THAT(first[0], testing::MatchesRegex("[0-9a-f]{32}"));
  EXPECT_NE(first, second);
  for (const std::string& bad : {std::string(129, 'x'), std::string("a b"),
                                 std::string("a\"b"), std::string()}) {
    EXPECT_THAT(RequestIds({{"x-request-id", bad}}),
                testing::ElementsAre(testing::MatchesRegex("[0-9a-f]{32}")))
        << bad;
  }
}

TEST_F(CallInterceptorTest, StreamsAndErrorsReturnTheIdToo) {
  const std::string name = CreateJob();
  grpc::ClientContext watch_context;
  watch_context.AddMetadata("x-request-id", "watch");
  v1::WatchJobRequest request;
  request.set_name(name);
  const auto watch = stub_->WatchJob(&watch_context, request);
  for (v1::WatchJobResponse response; watch->Read(&response);) continue;
  EXPECT_TRUE(watch->Finish().ok());
  EXPECT_THAT(Returned(watch_context), testing::ElementsAre("watch"));

  grpc::ClientContext error_context;
  error_context.AddMetadata("x-request-id", "error");
  v1::GetJobResponse response;
  EXPECT_FALSE(stub_->GetJob(&error_context, {}, &response).ok());
  EXPECT_THAT(Returned(error_context), testing::ElementsAre("error"));
}

TEST_F(CallInterceptorTest, AFinishedCallIsALineWithAllThatHelps) {
  RequestIds({{"x-request-id", "r1"}, {"traceparent", kTraceparent}});
  const auto lines = LinesOf(absl::StrCat(kService, "GetServerInfo"));
  ASSERT_EQ(lines.size(), 1);
  EXPECT_EQ(lines[0]["level"], "debug");
  EXPECT_EQ(lines[0]["code"], "OK");
  EXPECT_EQ(lines[0]["request_id"], "r1");
  EXPECT_EQ(lines[0]["traceparent"], kTraceparent);
  EXPECT_GE(lines[0]["seconds"].get<double>(), 0);
  EXPECT_THAT(lines[0]["peer"].get<std::string>(), HasSubstr("127.0.0.1"));
  EXPECT_THAT(lines[0]["message"].get<std::string>(), HasSubstr("request r1"));
}

TEST_F(CallInterceptorTest, AMalformedTraceparentIsLeftOut) {
  for (const char* bad :
       {"1", "00-XYZ", "zz",
        "00-00000000000000000000000000000000-b7ad6b7169203331-01"}) {
    RequestIds({{"traceparent", bad}});
  }
  for (const json& line : LinesOf(absl::StrCat(kService, "GetServerInfo"))) {
    EXPECT_FALSE(line.contains("traceparent"));
  }
}

TEST_F(CallInterceptorTest, AnErrorIsALineAtInfo) {
  grpc::ClientContext context;
  v1::GetJobResponse response;
  EXPECT_FALSE(stub_->GetJob(&context, {}, &response).ok());
  const auto lines = LinesOf(absl::StrCat(kService, "GetJob"));
  ASSERT_EQ(lines.size(), 1);
  EXPECT_EQ(lines[0]["level"], "info");
  EXPECT_EQ(lines[0]["code"], "INVALID_ARGUMENT");
  EXPECT_THAT(lines[0]["error"].get<std::string>(), HasSubstr("name"));
}

TEST_F(CallInterceptorTest, ALineNamesTheJobThatTheCallIsAbout) {
  const std::string name = CreateJob();
  Watch(name);
  const std::string id = name.substr(std::string("jobs/").size());
  const auto created = LinesOf(absl::StrCat(kService, "CreateJob"));
  const auto watched = LinesOf(absl::StrCat(kService, "WatchJob"));
  ASSERT_EQ(created.size(), 1);
  ASSERT_EQ(watched.size(), 1);
  EXPECT_EQ(created[0]["job"], id);
  EXPECT_EQ(watched[0]["job"], id);
}

TEST_F(CallInterceptorTest, EveryLineOfAJobHasTheRequestIdOfItsCall) {
  // One id that the client chose, and one that the server made.
  std::map<std::string, std::string> request_of_job;
  for (const std::string given : {"r1", ""}) {
    grpc::ClientContext context;
    if (!given.empty()) context.AddMetadata("x-request-id", given);
    v1::CreateJobResponse response;
    ASSERT_TRUE(stub_->CreateJob(&context, SphereJob(), &response).ok());
    Watch(response.job().name());
    const std::vector<std::string> returned = Returned(context);
    ASSERT_EQ(returned.size(), 1);
    EXPECT_THAT(returned[0], HasSubstr(given));
    request_of_job[response.job().name()] = returned[0];
  }
  server_->Shutdown(absl::ZeroDuration());  // it must not log any more
  int lines = 0;
  for (const json& line : log_.lines()) {
    if (!line.contains("state")) continue;
    const std::string name =
        absl::StrCat("jobs/", line["job"].get<std::string>());
    EXPECT_EQ(line["request_id"], request_of_job[name]) << line;
    ++lines;
  }
  EXPECT_EQ(lines, 6);  // QUEUED, RUNNING, SUCCEEDED
}

TEST_F(CallInterceptorTest, EveryLineOfAJobHasTheTraceOfItsCall) {
  std::string traced;
  for (const std::string given : {kTraceparent, "00-1-2-3"}) {
    grpc::ClientContext context;
    context.AddMetadata("traceparent", given);
    v1::CreateJobResponse response;
    ASSERT_TRUE(stub_->CreateJob(&context, SphereJob(), &response).ok());
    Watch(response.job().name());
    if (given == kTraceparent) traced = response.job().name();
  }
  server_->Shutdown(absl::ZeroDuration());  // it must not log any more
  int lines = 0;
  for (const json& line : log_.lines()) {
    if (!line.contains("state")) continue;
    const std::string name =
        absl::StrCat("jobs/", line["job"].get<std::string>());
    EXPECT_EQ(line.value("trace_id", ""),
              name == traced ? "0af7651916cd43dd8448eb211c80319c" : "")
        << line;
    ++lines;
  }
  EXPECT_EQ(lines, 6);  // QUEUED, RUNNING, SUCCEEDED
}

TEST_F(CallInterceptorTest, KeysAndMeshesStayOutOfTheLog) {
  const v1::CreateJobRequest request = SphereJob();
  grpc::ClientContext context;
  context.AddMetadata("authorization", "Bearer secret-one");
  context.AddMetadata("api-key", "secret-two");
  v1::CreateJobResponse response;
  EXPECT_TRUE(stub_->CreateJob(&context, request, &response).ok());
  Watch(response.job().name());
  server_->Shutdown(absl::ZeroDuration());
  EXPECT_THAT(log_.text(), Not(HasSubstr("secret-")));
  EXPECT_THAT(log_.text(), Not(HasSubstr("DRACO")));
  EXPECT_THAT(log_.text(), HasSubstr("SUCCEEDED"));
  EXPECT_FALSE(log_.lines().empty());
}

TEST_F(CallInterceptorTest, AServerWithoutAPortLogsNothing) {
  ServerConfig config;
  config.listen = "";
  const auto server = Server::Create(config, GatedEngine());
  ASSERT_TRUE(server.ok());
  const std::string before = log_.text();
  const auto stub =
      v1::CorrespondenceService::NewStub((*server)->InProcessChannel());
  grpc::ClientContext context;
  v1::GetJobResponse response;
  EXPECT_FALSE(stub->GetJob(&context, {}, &response).ok());
  EXPECT_EQ(log_.text(), before);
}

}  // namespace
}  // namespace isomatch
