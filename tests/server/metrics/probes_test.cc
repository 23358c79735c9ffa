#include "server/metrics/probes.h"

#include <chrono>
#include <memory>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "server/metrics/prometheus_metrics.h"
#include "tests/server/metrics/http_get.h"
#include "tests/support/matchers.h"

namespace isomatch {
namespace {

using boost::asio::ip::tcp;
using testing::AllOf;
using testing::EndsWith;
using testing::HasSubstr;
using testing::Not;
using testing::StartsWith;

class ProbesTest : public testing::Test {
 protected:
  void SetUp() override {
    const auto listens =
        metrics_.Listen("127.0.0.1:0", [] { return LoadFigures(); },
                        {.health = [this] { return health_; },
                         .readiness = [this] { return readiness_; }});
    ASSERT_THAT(listens, IsOk());
  }

  std::string Ask(const std::string& path,
                  const std::string& method = "GET") const {
    return HttpGet(metrics_.address(), path, method);
  }

  /// Connects, sends this, and stays.
  std::unique_ptr<tcp::iostream> Send(const std::string& request) const {
    const std::string address = metrics_.address();
    const size_t colon = address.rfind(':');
    auto stream = std::make_unique<tcp::iostream>(address.substr(0, colon),
                                                  address.substr(colon + 1));
    *stream << request << std::flush;
    return stream;
  }

  ProbeAnswer health_ = {true, "ok"};
  ProbeAnswer readiness_ = {true, "ready"};
  PrometheusMetrics metrics_{"1"};
};

TEST_F(ProbesTest, EachPathTellsWhatIsAskedThere) {
  EXPECT_THAT(Ask("/healthz"), AllOf(StartsWith("HTTP/1.1 200 OK\r\n"),
                                     HasSubstr("\r\nContent-Length: 3\r\n"),
                                     EndsWith("\r\n\r\nok\n")));
  EXPECT_THAT(Ask("/readyz"), AllOf(StartsWith("HTTP/1.1 200 OK\r\n"),
                                    EndsWith("\r\n\r\nready\n")));
  readiness_ = {false, "draining"};
  EXPECT_THAT(Ask("/readyz"),
              AllOf(StartsWith("HTTP/1.1 503 Service Unavailable\r\n"),
                    EndsWith("\r\n\r\ndraining\n")));
  EXPECT_THAT(Ask("/healthz"), StartsWith("HTTP/1.1 200"));
  health_ = {false, "stuck"};
  EXPECT_THAT(Ask("/healthz"),
              AllOf(StartsWith("HTTP/1.1 503"), EndsWith("\r\n\r\nstuck\n")));
  EXPECT_THAT(Ask("/metrics"), StartsWith("HTTP/1.1 200"));
}

TEST_F(ProbesTest, HeadIsGetWithoutABody) {
  EXPECT_THAT(
      Ask("/healthz", "HEAD"),
      AllOf(StartsWith("HTTP/1.1 200 OK\r\n"),
            HasSubstr("\r\nContent-Length: 3\r\n"), EndsWith("\r\n\r\n")));
  readiness_ = {false, "draining"};
  EXPECT_THAT(Ask("/readyz", "HEAD"),
              AllOf(StartsWith("HTTP/1.1 503"), EndsWith("\r\n\r\n")));
}

TEST_F(ProbesTest, OtherPathsAndMethodsAreNotThere) {
  for (const char* path : {"/healthz/", "/healthz/x", "/healthzz", "/ready",
                           "/readyz/../etc/passwd"}) {
    EXPECT_THAT(Ask(path), StartsWith("HTTP/1.1 404")) << path;
  }
  EXPECT_THAT(Ask("/healthz?x=1"), StartsWith("HTTP/1.1 200"));
  for (const char* method : {"POST", "PUT", "DELETE"}) {
    EXPECT_THAT(Ask("/healthz", method), StartsWith("HTTP/1.1 40")) << method;
  }
}

TEST_F(ProbesTest, NobodyIsKeptFromAnAnswerForLong) {
  // Silent ones, one half a request each, and bodies that never end.
  std::vector<std::unique_ptr<tcp::iostream>> peers;
  for (int i = 0; i < 25; ++i) {
    peers.push_back(Send(""));
    peers.push_back(Send("GET /healthz HTTP/1.1\r\nHost: x\r\n"));
    for (const char* path : {"/healthz", "/metrics", "/other"}) {
      peers.push_back(Send(std::string("GET ") + path +
                           " HTTP/1.1\r\nHost: x\r\n"
                           "Content-Length: 1000000000\r\n\r\nx"));
    }
  }
  const auto begin = std::chrono::steady_clock::now();
  EXPECT_THAT(Ask("/healthz"), StartsWith("HTTP/1.1 200"));
  EXPECT_LT(std::chrono::steady_clock::now() - begin, std::chrono::seconds(3));
}

TEST_F(ProbesTest, ABodyThatComesForEverHoldsNobody) {
  const auto peer = Send(
      "GET /metrics HTTP/1.1\r\nHost: x\r\nContent-Length: 1000000000\r\n\r\n");
  // The library's own end would be a silent second and a half.
  peer->expires_after(std::chrono::seconds(1));
  const std::string answer{std::istreambuf_iterator<char>(*peer), {}};
  EXPECT_THAT(answer, StartsWith("HTTP/1.1 200"));
  EXPECT_EQ(peer->error(), boost::asio::error::eof);
}

TEST_F(ProbesTest, HeadersThatAreTooLargeAreRefused) {
  const std::string answer = HttpAsk(
      metrics_.address(),
      "GET /healthz HTTP/1.1\r\nX: " + std::string(100'000, 'x') + "\r\n\r\n");
  EXPECT_THAT(answer, Not(HasSubstr("\r\n\r\nok\n")));
  EXPECT_THAT(Ask("/healthz"), StartsWith("HTTP/1.1 200"));
}

}  // namespace
}  // namespace isomatch
