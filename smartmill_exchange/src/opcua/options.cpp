// Rules of the address and of its protection, which need no library.
#include "listen.h"
#include "smartmill_core/error.h"
#include "smartmill_exchange/opcua/server.h"

namespace smartmill::exchange {

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
