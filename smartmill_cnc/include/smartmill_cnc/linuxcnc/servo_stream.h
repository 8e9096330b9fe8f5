#pragma once

#include <array>
#include <cstdint>
#include <limits>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "smartmill_cnc/linuxcnc/local_socket.h"

namespace smartmill::cnc::linuxcnc {

struct ServoClockOptions {
  double settling = 0.5;  ///< [s] of arrivals before times are defined; one of them has no delay
  double window = 10.0;   ///< [s] that contains a sample without delay, even on a busy computer
  double slew =
      1e-4;  ///< [1] largest correction of the time of sample 0, per time; ten times the clocks' difference
};

/// Assigns times to evenly sampled, numbered samples. No sample arrives before it is taken, and the earliest
/// arrivals have no delay; they define the time of sample 0. It is tracked slowly (the two clocks differ by
/// about 1e-5), so that neighbouring samples stay one period apart.
class ServoClock {
 public:
  /// @param period [s] of the samples
  explicit ServoClock(double period, const ServoClockOptions& options = {})
      : options_(options), period_(period) {}

  /// @param number of a received sample @param arrival [s]
  void addArrival(std::uint64_t number, double arrival);
  /// Whether enough arrivals are known for timeOf().
  bool settled() const { return settled_; }
  double timeOf(std::uint64_t number) const {
    return zero_ + static_cast<double>(number) * period_;
  }  ///< [s]

 private:
  ServoClockOptions options_;
  double period_, zero_ = 0.0, begun_ = 0.0, window_begun_ = 0.0, last_ = 0.0;
  double window_ = std::numeric_limits<double>::infinity(), previous_window_ = window_;
  bool started_ = false, settled_ = false;
};

/// Statistics of the received samples.
struct ServoStatistics {
  std::uint64_t samples = 0, lost = 0, restarts = 0;
  std::uint64_t without_load = 0;                             ///< samples whose load was too old
  double late_median = 0.0, late_99 = 0.0, late_worst = 0.0;  ///< [s] delay of the arrival
};

/// Consecutive samples with their times.
struct ServoSegment {
  double stamp = 0.0;       ///< [s] of the first
  std::uint64_t first = 0;  ///< running index of the first since the controller's start
  std::vector<ServoSample> samples;
};

struct ServoStreamOptions {
  std::size_t segment_length = 10;     ///< [samples] of 1 ms: 100 messages a second
  double retry_period = 0.2;           ///< [s] between two attempts to connect
  std::uint64_t restart_gap = 60'000;  ///< [samples] a larger gap is a restart of the controller: a minute
  /// [s] age of the last value of setLoad() up to which the load of a sample is valid, else it is NaN;
  /// infinite: the drive itself writes the load
  double load_timeout = std::numeric_limits<double>::infinity();
};

/// Every servo cycle of the controller, from linuxcnc_stream. One thread calls step(); the const functions
/// and setLoad() may be called from any thread.
class ServoStream {
 public:
  /// @param folder of the machine
  explicit ServoStream(const std::string& folder, const ServoStreamOptions& options = {});

  /// Connects if an attempt is scheduled, then waits for data and reads. @param wait [s] at most @param now
  /// clock [s]
  std::vector<ServoSegment> step(double wait, double (*now)());
  /// Processes one block; called by step().
  std::vector<ServoSegment> addBlock(ServoBlock block, double arrival);

  std::optional<ServoSample> latest() const;  ///< empty before the first
  std::uint64_t count() const;                ///< [1] received samples
  /// Value of a load meter outside the controller. @param stamp [s] of its measurement @param spindle_load
  /// [1]
  void setLoad(double stamp, double spindle_load);
  ServoStatistics statistics() const;

 private:
  static constexpr std::size_t LATE_BINS = 1000;

  void restart(const ServoBlock& block);
  void countLate(double late);

  const std::string path_;
  const ServoStreamOptions options_;
  LocalConnection connection_;
  double last_attempt_ = -std::numeric_limits<double>::infinity();
  ServoClock clock_{1e-3};
  std::uint64_t next_ = 0;  // expected running index
  bool begun_ = false;
  ServoSegment segment_;

  mutable std::mutex mutex_;  // guards the members below
  ServoStatistics statistics_;
  std::array<std::uint64_t, LATE_BINS> late_{};
  std::optional<ServoSample> latest_;
  std::optional<double> load_;  // to be sent
  double load_stamp_ = -std::numeric_limits<double>::infinity();
};

}  // namespace smartmill::cnc::linuxcnc
