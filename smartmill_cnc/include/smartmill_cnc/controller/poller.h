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
  struct Counts {
    int made = 0, lost = 0, attempts = 0;
  };

  /// @param reconnect_period [s] between the first two attempts; each further one waits twice as long, at
  /// most eight times
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
  const Counts& counts() const { return counts_; }

 private:
  void connect();

  Controller& controller_;
  double reconnect_period_;
  double wait_;       // [s] from the last attempt to the next
  int failures_ = 0;  // one after the other
  Counts counts_;
  Log& log_;
  std::optional<Reading> reading_;
  std::string identity_;
  double next_connect_ = -std::numeric_limits<double>::infinity();  // [s]
  bool connected_ = false, loss_told_ = false, turned_away_ = false;
  std::string last_error_ = "not connected yet", told_error_ = "not connected yet";
};

}  // namespace smartmill::cnc
