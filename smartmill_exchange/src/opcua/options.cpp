// Rules of the address and of its protection, which need no library.
#include <cctype>

#include "smartmill_core/error.h"
#include "smartmill_exchange/opcua/server.h"

namespace smartmill::exchange {

bool isLoopbackAddress(const std::string& address) {
  if (address == "::1") return true;
  bool numeric = address.rfind("127.", 0) == 0;
  for (const char c : address) numeric = numeric && (std::isdigit(static_cast<unsigned char>(c)) || c == '.');
  return numeric;
}

void check(const OpcUaOptions& options) {
  if (options.user.empty() != options.password_file.empty())
    throw Error("opcua_user and opcua_password_file: expected both or neither");
  if (options.certificate_file.empty() != options.key_file.empty())
    throw Error("opcua_certificate_file and opcua_key_file: expected both or neither");
  if (isLoopbackAddress(options.address)) return;
  if (options.user.empty())
    throw Error("opcua_address: " + options.address +
                " can be reached from other computers, expected opcua_user and opcua_password_file");
  if (options.certificate_file.empty())
    throw Error("opcua_address: " + options.address +
                " can be reached from other computers, expected opcua_certificate_file and opcua_key_file");
}

}  // namespace smartmill::exchange
