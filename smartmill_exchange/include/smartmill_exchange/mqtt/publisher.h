#pragma once

#include <cstdint>
#include <memory>
#include <string>

#include "smartmill_exchange/items/asset.h"
#include "smartmill_exchange/items/observation.h"

namespace smartmill::exchange {

struct MqttOptions {
  std::string broker;                ///< mqtt://HOST:PORT or mqtts://HOST:PORT
  std::string prefix = "smartmill";  ///< of the topics; unique for each machine of a broker
  std::string client = "smartmill";  ///< client identifier, unique at the broker
  std::string user, password_file;   ///< empty: none
  std::string ca_file;               ///< certificates that sign the broker's; empty: those of the system
};

/// Whether the host of an address (mqtt://HOST:PORT) is this computer: localhost, 127.x.x.x, [::1].
bool isLoopback(const std::string& broker);

/// @throws Error on an address of another form, and on a broker on another computer without TLS and user
void check(const MqttOptions& options);

struct MqttStatistics {
  bool connected = false;
  std::uint64_t published = 0;    ///< messages that the broker has confirmed
  std::uint64_t replaced = 0;     ///< payloads that were replaced by a newer one before they were sent
  std::uint64_t connections = 0;  ///< since the start
  std::size_t waiting = 0;        ///< topics
  std::string problem;            ///< of the last attempt to connect; empty: none
};

/// Publishes items and assets as retained messages with quality of service 1 to PREFIX/items/ID and
/// PREFIX/assets/ID, catalogue and schema to PREFIX/catalogue and PREFIX/schema, and `online` or `offline`
/// (also as last will) to PREFIX/status. It subscribes to nothing. After a lost connection it connects again
/// and publishes all topics.
class MqttPublisher {
 public:
  /// @throws Error as check(), and if this build has no MQTT. A broker that does not answer is no error.
  explicit MqttPublisher(const MqttOptions& options);
  /// Publishes what waits, at most for a second, then `offline`.
  ~MqttPublisher();

  // Thread-safe.
  void observe(const Observation& observation);
  void store(const Asset& asset);
  MqttStatistics statistics() const;

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace smartmill::exchange
