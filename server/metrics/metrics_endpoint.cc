#include "server/metrics/metrics_endpoint.h"

#include <cstdint>
#include <future>
#include <string>
#include <utility>
#include <vector>

#include <CivetServer.h>
#include <boost/asio/ip/tcp.hpp>

#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/time/time.h"

namespace isomatch {
namespace {

/// So many peers that send half a request each delay nobody. Each takes some
/// 30 KiB.
constexpr char kThreads[] = "64";

std::vector<std::string> EndpointOptions(const std::string& address) {
  // A request whose header is not there in time is given up, at the latest
  // twice that later, since the library looks after each read. Those that wait
  // are served in their order.
  return {"listening_ports",    address, "num_threads", kThreads,
          "request_timeout_ms", "1500"};
}

/// The web server that this thread has opened last: prometheus::Exposer keeps
/// it to itself, but has it tell who asks.
thread_local mg_context* opened = nullptr;

void OnOpened(const mg_context* context) {
  opened = const_cast<mg_context*>(context);
}

/// The library would read what a request brings, however slowly that comes,
/// before the next one on the connection: so there is none.
int OnRequest(mg_connection* connection) {
  mg_disable_connection_keep_alive(connection);
  return 0;  // go on
}

/// A handler of the library: returns the status, or 0 for what it does not
/// answer.
int AnswerProbe(mg_connection* connection, void* data) {
  const std::string method = mg_get_request_info(connection)->request_method;
  if (method != "GET" && method != "HEAD") return 0;
  const ProbeAnswer answer = (*static_cast<const Probe*>(data))();
  const std::string body = answer.line + "\n";
  const std::string text = absl::StrCat(
      "HTTP/1.1 ", answer.is_well ? "200 OK" : "503 Service Unavailable",
      "\r\nContent-Type: text/plain; charset=utf-8\r\nContent-Length: ",
      body.size(), "\r\nCache-Control: no-store\r\nConnection: close\r\n\r\n",
      method == "GET" ? body : "");
  mg_write(connection, text.data(), text.size());
  return answer.is_well ? 200 : 503;
}

void AddProbe(mg_context* server, const char* path, const Probe& probe) {
  mg_set_request_handler(server, path, AnswerProbe, const_cast<Probe*>(&probe));
}

using boost::asio::ip::tcp;

/// Where this machine reaches what listens on HOST:PORT.
tcp::endpoint Reach(const std::string& listening) {
  namespace ip = boost::asio::ip;
  const size_t colon = listening.rfind(':');
  int port = 0;
  (void)absl::SimpleAtoi(listening.substr(colon + 1), &port);
  boost::system::error_code is_name;
  ip::address address = ip::make_address(listening.substr(0, colon), is_name);
  if (is_name || address.is_unspecified()) {
    address = ip::address_v4::loopback();
  }
  return {address, static_cast<std::uint16_t>(port)};
}

/// Connects and hangs up.
void Knock(const tcp::endpoint& endpoint) {
  boost::asio::io_context context;
  tcp::socket socket(context);
  boost::system::error_code ignored;
  socket.connect(endpoint, ignored);
}

}  // namespace

std::unique_ptr<prometheus::Exposer> OpenEndpoint(const std::string& address,
                                                  const Probes& probes) {
  CivetCallbacks callbacks;
  callbacks.init_context = OnOpened;
  callbacks.begin_request = OnRequest;
  auto exposer = std::make_unique<prometheus::Exposer>(EndpointOptions(address),
                                                       &callbacks);
  AddProbe(opened, "/healthz$", probes.health);  // $: nothing behind it
  AddProbe(opened, "/readyz$", probes.readiness);
  return exposer;
}

// The library looks only every 2 s whether it is to stop, unless somebody
// calls: far too long for a server that stops.
void CloseEndpoint(std::unique_ptr<prometheus::Exposer> exposer,
                   const std::string& address) {
  const tcp::endpoint endpoint = Reach(address);
  const auto stopped =
      std::async(std::launch::async, [&exposer] { exposer.reset(); });
  constexpr absl::Duration kKnockAgain = absl::Milliseconds(10);
  do {
    Knock(endpoint);
  } while (stopped.wait_for(absl::ToChronoMilliseconds(kKnockAgain)) !=
           std::future_status::ready);
}

}  // namespace isomatch
