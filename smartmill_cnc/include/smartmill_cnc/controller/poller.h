#pragma once

#include <limits>
#include <optional>
#include <string>

#include "smartmill_cnc/controller/controller.h"
#include "smartmill_cnc/log.h"

namespace smartmill::cnc {

struct PollerOptions {
  double reconnect_period = 1.0;  ///< [s] between the first two attempts; the interval doubles
  double longest_wait =
      8.0;  ///< [1] limit of the interval, of reconnect_period: a restart is found within 8 s
};

/// Maintains the connection to a controller and reads it once per period. A loss or a failure to connect is
/// logged once, not in every period.
class Poller {
 public:
  struct Counts {
    int made = 0, lost = 0, attempts = 0;
  };

  Poller(Controller& controller, const PollerOptions& options, Log& log);

  /// Connects if an attempt is scheduled, then reads. @param now [s] any steady time.
  void fetch(double now);
  /// The reading of fetch(), once; empty without a connection. Logs a new connection.
  std::optional<Reading> takeReading();

  /// Stores why the connection was lost during a command. @param why one line
  void setError(const std::string& why) { last_error_ = why; }
  const std::string& lastError() const { return last_error_; }
  /// To be called in a period without a connection; logs a new loss or a new reason.
  void reportDisconnected();
  const Counts& counts() const { return counts_; }

 private:
  void connect();

  Controller& controller_;
  PollerOptions options_;
  double wait_;       // [s] between the last attempt and the next
  int failures_ = 0;  // consecutive
  Counts counts_;
  Log& log_;
  std::optional<Reading> reading_;
  std::string identity_;
  double next_connect_ = -std::numeric_limits<double>::infinity();  // [s]
  bool connected_ = false, loss_logged_ = false, refused_ = false;
  std::string last_error_ = "not connected yet", logged_error_ = "not connected yet";
};

}  // namespace smartmill::cnc
