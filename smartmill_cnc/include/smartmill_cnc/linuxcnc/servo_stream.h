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

/// Gives evenly counted samples their times: a sample cannot arrive before it was taken, and one that waited
/// for nobody arrives at once. So the count's zero lies where the earliest arrivals say, followed slowly (the
/// two clocks differ by some 1e-5), which leaves the times of neighbours one period apart.
class ServoClock {
 public:
  /// @param period [s] of the samples
  explicit ServoClock(double period) : period_(period) {}

  /// A sample has come. @param arrival [s]
  void addArrival(std::uint64_t number, double arrival);
  /// Enough has been seen to say times.
  bool settled() const { return settled_; }
  double timeOf(std::uint64_t number) const {
    return zero_ + static_cast<double>(number) * period_;
  }  ///< [s]

 private:
  double period_, zero_ = 0.0, begun_ = 0.0, window_begun_ = 0.0, last_ = 0.0;
  double window_ = std::numeric_limits<double>::infinity(), previous_window_ = window_;
  bool started_ = false, settled_ = false;
};

/// How the samples have come so far.
struct ServoStatistics {
  std::uint64_t samples = 0, lost = 0, restarts = 0;
  double late_median = 0.0, late_99 = 0.0, late_worst = 0.0;  ///< [s] arrival after the sample's own time
};

/// Samples that follow one another, with their times.
struct ServoSegment {
  double stamp = 0.0;       ///< [s] of the first
  std::uint64_t first = 0;  ///< running index of the first, of one start of the controller
  std::vector<ServoSample> samples;
};

/// Every servo cycle of the controller, from linuxcnc_stream. May be used from two threads: one that calls
/// step(), others that look.
class ServoStream {
 public:
  static constexpr std::size_t SEGMENT_LENGTH = 10;  ///< samples handed out together

  /// @param folder of the machine
  explicit ServoStream(const std::string& folder);

  /// Connects when it is time to, waits for at most that long, reads. @param now [s] of arrival
  std::vector<ServoSegment> step(double wait, double (*now)());
  /// What step() does with a block, for itself.
  std::vector<ServoSegment> addBlock(const ServoBlock& block, double arrival);

  std::optional<ServoSample> latest() const;  ///< none before the first
  std::uint64_t count() const;                ///< samples that have come
  void setLoad(double spindle_load);
  ServoStatistics statistics() const;

 private:
  static constexpr std::size_t LATE_BINS = 1000;

  void restart(const ServoBlock& block);
  void countLate(double late);

  const std::string path_;
  LocalConnection connection_;
  double last_attempt_ = -std::numeric_limits<double>::infinity();
  ServoClock clock_{1e-3};
  std::uint64_t next_ = 0;  // running index due
  bool begun_ = false;
  ServoSegment segment_;

  mutable std::mutex mutex_;  // of what follows
  ServoStatistics statistics_;
  std::array<std::uint64_t, LATE_BINS> late_{};
  std::optional<ServoSample> latest_;
  std::optional<double> load_;
};

}  // namespace smartmill::cnc::linuxcnc
