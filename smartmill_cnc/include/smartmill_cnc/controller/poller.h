#pragma once

#include <limits>
#include <optional>
#include <string>

#include "smartmill_cnc/controller/controller.h"
#include "smartmill_cnc/log.h"

namespace smartmill::cnc {

/// Keeps the connection to a controller and reads it once a period. A loss, or that no connection comes
/// about, is told in one line, not in one a period.
class Poller {
 public:
  /// @param reconnect_period [s] between two attempts
  Poller(Controller& controller, double reconnect_period, Log& log);

  /// Connects when it is time to, reads. @param now [s] any steady time.
  void fetch(double now);
  /// What fetch() read, once; nothing without connection. Tells of a connection that came about.
  std::optional<Reading> take();

  /// The connection went while somebody talked; why, in one line.
  void failed(const std::string& why) { last_error_ = why; }
  const std::string& lastError() const { return last_error_; }
  /// There is no connection in this period. Tells of it, when that is news.
  void lost();

 private:
  void connect();

  Controller& controller_;
  double reconnect_period_;
  Log& log_;
  std::optional<Reading> reading_;
  std::string identity_;
  double next_connect_ = -std::numeric_limits<double>::infinity();  // [s]
  bool connected_ = false, loss_told_ = false;
  std::string last_error_ = "not connected yet", told_error_ = "not connected yet";
};

}  // namespace smartmill::cnc
