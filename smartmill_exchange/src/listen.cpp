#include "listen.h"

#include <cctype>

#include "smartmill_core/error.h"

namespace smartmill::exchange {

bool isLoopbackAddress(const std::string& address) {
  if (address == "::1") return true;
  bool numeric = address.rfind("127.", 0) == 0;
  for (const char c : address) numeric = numeric && (std::isdigit(static_cast<unsigned char>(c)) || c == '.');
  return numeric;
}

int listenAt(boost::asio::ip::tcp::acceptor& acceptor, const std::string& address, int port,
             const char* key) {
  namespace asio = boost::asio;
  boost::system::error_code failed;
  const auto ip = asio::ip::make_address(address, failed);
  if (failed) throw Error(std::string(key) + ": '" + address + "', expected an IP address");
  const asio::ip::tcp::endpoint endpoint(ip, static_cast<unsigned short>(port));
  acceptor.open(endpoint.protocol(), failed);
  if (!failed) acceptor.set_option(asio::socket_base::reuse_address(true), failed);
  if (!failed) acceptor.bind(endpoint, failed);
  if (!failed) acceptor.listen(asio::socket_base::max_listen_connections, failed);
  if (failed) throw Error(address + ":" + std::to_string(port) + ": cannot listen: " + failed.message());
  return acceptor.local_endpoint().port();
}

}  // namespace smartmill::exchange
