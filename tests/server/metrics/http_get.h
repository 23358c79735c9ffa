#pragma once

#include <string>

#include <boost/asio/ip/tcp.hpp>

namespace isomatch {

/// Returns the whole answer of HOST:PORT to these bytes.
inline std::string HttpAsk(const std::string& address,
                           const std::string& request) {
  const size_t colon = address.rfind(':');
  boost::asio::ip::tcp::iostream stream(address.substr(0, colon),
                                        address.substr(colon + 1));
  stream << request << std::flush;
  return {std::istreambuf_iterator<char>(stream), {}};
}

/// Returns the whole answer to GET `path` from HOST:PORT, headers first.
inline std::string HttpGet(const std::string& address, const std::string& path,
                           const std::string& method = "GET") {
  return HttpAsk(address, method + " " + path + " HTTP/1.1\r\nHost: " +
                              address + "\r\nConnection: close\r\n\r\n");
}

}  // namespace isomatch
