#include "server/metrics/metrics_endpoint.h"

#include <cstdint>
#include <future>
#include <string>
#include <utility>
#include <vector>

#include <boost/asio/ip/tcp.hpp>

#include "absl/strings/numbers.h"
#include "absl/time/time.h"

namespace isomatch {
namespace {

std::vector<std::string> EndpointOptions(const std::string& address) {
  return {"listening_ports", address, "num_threads", "2",
          // A peer that says nothing does not hold a thread for long.
          "request_timeout_ms", "10000"};
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

std::unique_ptr<prometheus::Exposer> OpenEndpoint(const std::string& address) {
  return std::make_unique<prometheus::Exposer>(EndpointOptions(address));
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
