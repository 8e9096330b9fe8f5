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

/// Single-point turning after Kim (eq. 1 to 4, fig. 3) with the deviations of a real lathe: a cutting force
/// that is not proportional to the chip thickness, a tool that may leave the cut, an actuator with bandwidth,
/// delay and stroke, and sensor noise. Units and meaning: declare().
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

  /// Commands of the tool position, one channel "command" [m]; a command takes effect after the sample of its
  /// index. Commands for past samples take effect at once and are counted.
  /// @throws Error without this channel, or in another unit.
  void command(const SampleBlock& commands);

  /// Cut from the next sample on; without a call, the nominal one. @param feed [m] per revolution; 0: the
  /// tool is out of the cut, and the next cut meets a surface without waves. @param width [1] width of cut
  /// over that of cutting_stiffness
  void engage(double feed, double width);

  /// Sensor signals and true values.
  struct Block {
    SampleBlock displacement;  ///< deflection, tool [m]: probes at workpiece and tool; headstock [m/s2]
    SampleBlock vibration;     ///< headstock [m/s2]
    SpindleAngle angle;        ///< at the first sample
    std::vector<double> motion, force;  ///< true: deflection minus tool position [m], cutting force [N]
  };
  /// The next samples. @param count > 0
  Block advance(std::size_t count);

  /// Whether commands for the next samples have arrived, or none at all.
  bool hasCommands(std::size_t count) const { return newest_ == 0 || newest_ + 1 >= index_ + count; }

  std::uint64_t late() const { return late_; }  ///< commands that arrived after their sample

 private:
  double pastSurface() const;
  double force(double chip) const;
  double servo();

  LatheTraits traits_;
  ModalFilter machine_, servo_filter_;
  std::mt19937_64 random_;
  std::normal_distribution<double> normal_;
  std::deque<double> surface_;  // [m] surface left by the edge, newest first
  std::deque<double> delayed_;  // [m] delayed commands of the servo
  std::map<std::uint64_t, double> commands_;
  double commanded_ = 0.0, tool_ = 0.0, last_force_ = 0.0;
  double feed_, width_ = 1.0;  // [m], [1] of the present cut
  std::uint64_t index_ = 0, late_ = 0, newest_ = 0;
};

}  // namespace smartmill::sim
