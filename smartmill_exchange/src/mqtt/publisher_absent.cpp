// Replaces publisher_paho.cpp without the library Paho.
#include "smartmill_core/error.h"
#include "smartmill_exchange/mqtt/publisher.h"

namespace smartmill::exchange {

class MqttPublisher::Impl {};

MqttPublisher::MqttPublisher(const MqttOptions& options) {
  check(options);
  throw Error("mqtt_broker: " + options.broker +
              ": this build has no MQTT; install libpaho-mqttpp-dev and libpaho-mqtt-dev, and build again");
}

MqttPublisher::~MqttPublisher() = default;

void MqttPublisher::observe(const Observation&) {
}

void MqttPublisher::store(const Asset&) {
}

MqttStatistics MqttPublisher::statistics() const {
  return {};
}

}  // namespace smartmill::exchange
