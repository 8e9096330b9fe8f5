#pragma once

#include <string>

#include <boost/asio/ip/tcp.hpp>

namespace smartmill::exchange {

/// Whether an address reaches this computer only: 127.x.x.x, ::1.
bool isLoopbackAddress(const std::string& address);

/// Opens a listener. @param port [1] 0: any free one @param key of the parameter with the address, for the
/// message. @return the port. @throws Error when the address is none, or the port is in use
int listenAt(boost::asio::ip::tcp::acceptor& acceptor, const std::string& address, int port, const char* key);

}  // namespace smartmill::exchange
