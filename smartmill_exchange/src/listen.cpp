#include "listen.h"

#include "smartmill_core/error.h"

namespace smartmill::exchange {

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
