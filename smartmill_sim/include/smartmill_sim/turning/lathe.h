#pragma once

#include <array>
#include <cstdint>
#include <deque>
#include <map>
#include <random>
#include <vector>

#include "smartmill_core/modal/modal_filter.h"
#include "smartmill_core/parameters/parameter_table.h"
#include "smartmill_core/signal/streams.h"

namespace smartmill::sim {

/// Single-point turning after Kim (eq. 1 to 4, fig. 3), with what a real lathe adds: a chip force that is not
/// proportional to the chip, a tool that leaves the cut, an actuator that has a bandwidth, a delay and a
/// stroke, sensors with noise.
struct LatheTraits {
  std::uint64_t seed = 1;
  double rate = 10000.0;
  double spindle_speed = 57.5;
  double chip = 1.0e-4;
  double overlap = 1.0;
  double cutting_stiffness = 2.0e6;
  double chip_exponent = 1.0;
  std::vector<double> frequency{55.7042};
  std::vector<double> damping_ratio{0.02};
  std::vector<double> stiffness{2.0e7};
  double servo_frequency = 800.0;
  double servo_damping = 0.7;
  double servo_delay = 0.0;
  double servo_stroke = 5.0e-4;
  double probe_noise = 1.0e-8;
  double accelerometer_noise = 2.0e-3;

  void declare(ParameterTable& table);
  /// @throws Error naming key and value.
  void validate() const;
};

class Lathe {
 public:
  /// @throws Error on bad traits.
  explicit Lathe(const LatheTraits& traits);

  /// Commands of the tool's position, one channel "command" [m]; first_index tells after which sample each is
  /// to be taken up. What comes for samples that are past takes effect at once and is counted.
  /// @throws Error without such a channel, or in another unit.
  void command(const SampleBlock& commands);

  /// What sensors show, and what is true.
  struct Block {
    SampleBlock displacement;  ///< deflection, tool [m]: probes at workpiece and tool; headstock [m/s2]
    SampleBlock vibration;     ///< headstock [m/s2]
    SpindleAngle angle;        ///< at the first sample
    std::vector<double> motion, force;  ///< true: deflection less tool [m], chip force [N]
  };
  /// The next samples. @param count > 0
  Block advance(std::size_t count);

  /// Whether commands are known for the next samples, or none has come at all.
  bool commanded(std::size_t count) const { return newest_ == 0 || newest_ + 1 >= index_ + count; }

  std::uint64_t late() const { return late_; }  ///< commands that came after their sample

 private:
  double pastSurface() const;
  double force(double chip) const;
  double servo();

  LatheTraits traits_;
  ModalFilter machine_, servo_filter_;
  std::mt19937_64 random_;
  std::normal_distribution<double> normal_;
  std::deque<double> surface_;  // [m] what the edge left, newest first
  std::deque<double> delayed_;  // [m] commands on their way into the servo
  std::map<std::uint64_t, double> commands_;
  double commanded_ = 0.0, tool_ = 0.0, last_force_ = 0.0;
  std::uint64_t index_ = 0, late_ = 0, newest_ = 0;
};

}  // namespace smartmill::sim
