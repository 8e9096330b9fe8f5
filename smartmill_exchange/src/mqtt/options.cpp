// Rules of the connection to a broker, which need no library.
#include <cctype>

#include "listen.h"
#include "smartmill_core/error.h"
#include "smartmill_exchange/mqtt/publisher.h"

namespace smartmill::exchange {
namespace {

struct Address {
  std::string scheme, host, port;
};

Address addressOf(const std::string& broker) {
  const std::size_t begin = broker.find("://");
  const std::size_t colon = broker.rfind(':');
  const bool whole = begin != std::string::npos && colon != std::string::npos && colon > begin + 3 &&
                     colon + 1 < broker.size();
  if (whole) {
    const Address address{broker.substr(0, begin), broker.substr(begin + 3, colon - begin - 3),
                          broker.substr(colon + 1)};
    bool good = address.scheme == "mqtt" || address.scheme == "mqtts";
    for (const char c : address.port) good = good && std::isdigit(static_cast<unsigned char>(c));
    good = good && address.host.find_first_of("/@ ") == std::string::npos && address.port.size() <= 5;
    if (good) return address;
  }
  throw Error("mqtt_broker: '" + broker + "', expected mqtt://HOST:PORT or mqtts://HOST:PORT");
}

}  // namespace

bool isLoopback(const std::string& broker) {
  const std::string host = addressOf(broker).host;
  return host == "localhost" || host == "[::1]" || isLoopbackAddress(host);
}

void check(const MqttOptions& options) {
  const Address address = addressOf(options.broker);
  if (options.prefix.empty() || options.prefix.find_first_of("+#$") != std::string::npos)
    throw Error("mqtt_prefix: '" + options.prefix + "', expected topic levels without +, # and $");
  if (options.client.empty())
    throw Error("mqtt_client: empty, expected an identifier that is unique at the broker");
  if (!options.password_file.empty() && options.user.empty())
    throw Error("mqtt_password_file: given without mqtt_user");
  if (isLoopback(options.broker)) return;
  if (address.scheme != "mqtts")
    throw Error("mqtt_broker: " + options.broker + " is another computer, expected TLS (mqtts://HOST:PORT)");
  if (options.user.empty() || options.password_file.empty())
    throw Error("mqtt_broker: " + options.broker +
                " is another computer, expected mqtt_user and mqtt_password_file");
}

}  // namespace smartmill::exchange
