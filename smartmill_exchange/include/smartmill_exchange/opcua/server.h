#pragma once

#include <cstdint>
#include <memory>
#include <string>

#include "smartmill_exchange/items/asset.h"
#include "smartmill_exchange/items/observation.h"

namespace smartmill::exchange {

struct OpcUaOptions {
  std::string address = "127.0.0.1";       ///< IP address to listen at
  int port = 4840;                         ///< [1]
  std::string device = "SmartMill";        ///< name of the machine
  std::string uuid = "smartmill-1";        ///< of the machine, unique in the shop
  std::string manufacturer, model;         ///< empty: unknown
  std::string user, password_file;         ///< empty: everybody on this computer
  std::string certificate_file, key_file;  ///< DER or PEM; empty: connections without encryption
  std::size_t most_clients = 32;           ///< [1] sessions at a time
};

/// @throws Error on an address other than loopback without user, password and certificate, and on half of a
/// pair
void check(const OpcUaOptions& options);

struct OpcUaStatistics {
  std::size_t sessions = 0;   ///< [1] open now
  std::uint64_t refused = 0;  ///< [1] sessions since the start, of users unknown and of too many clients
  std::uint64_t written = 0;  ///< [1] values since the start
};

/// OPC UA server of one machine, read-only, in a thread of its own. The address space follows OPC 40001-1
/// (Machinery) and 40501-1 (Machine Tools) in its folders, without their type definitions:
/// Objects/Machines/DEVICE with Identification, Monitoring (components and data items, see catalogue()) and
/// Assets. An unavailable value has the status Bad_NoCommunication. All functions are thread-safe.
class OpcUaServer {
 public:
  /// @throws Error as check(), when the port cannot be listened at, and if this build has no OPC UA
  explicit OpcUaServer(const OpcUaOptions& options);
  ~OpcUaServer();

  void observe(const Observation& observation);
  void store(const Asset& asset);
  OpcUaStatistics statistics() const;

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace smartmill::exchange
