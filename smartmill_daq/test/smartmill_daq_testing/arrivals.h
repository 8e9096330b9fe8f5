#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <random>

namespace smartmill::daq::testing {

/// When a converter that is off delivers its batches to the computer.
class Arrivals {
 public:
  enum class Kind {
    tcp,  ///< delay exponential with 0.2 ms, one batch in fifty held back by up to 10 ms
    usb   ///< at the next frame of 1 ms, then exponential with 30 us, one in a hundred up to 5 ms
  };

  /// @param ppm by which its samples take longer
  Arrivals(Kind kind, double rate, double ppm, std::uint64_t seed)
      : kind_(kind), rate_(rate), stretch_(1.0 + 1e-6 * ppm), random_(seed) {}

  /// [s] at which a number of samples is complete
  double trueTime(double count) const { return START + count / rate_ * stretch_; }
  double shortestDelay() const { return kind_ == Kind::tcp ? 0.3e-3 : 0.5e-3; }  // [s]

  /// [s] of the batch that completes a number of samples
  double next(double count) {
    std::exponential_distribution<double> tcp(1.0 / 0.2e-3), scheduler(1.0 / 30e-6);
    std::uniform_real_distribution<double> share(0.0, 1.0);
    double time = trueTime(count);
    if (kind_ == Kind::tcp) {
      time += tcp(random_);
      if (share(random_) < 0.02) time += 10e-3 * share(random_);
    } else {
      time = FRAME * std::ceil((time - START + 0.37e-3) / FRAME) + START + scheduler(random_);
      if (share(random_) < 0.01) time += 5e-3 * share(random_);
    }
    return last_ = std::max(last_, time + shortestDelay());
  }

  static constexpr double START = 1.8e9;  // [s]

 private:
  static constexpr double FRAME = 1e-3;  // [s]

  Kind kind_;
  double rate_, stretch_;
  std::mt19937_64 random_;
  double last_ = 0.0;
};

}  // namespace smartmill::daq::testing
