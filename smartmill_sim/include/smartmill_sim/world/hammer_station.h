#pragma once

#include <array>
#include <optional>

#include "smartmill_core/cutting/tool.h"
#include "smartmill_core/model/machine_model.h"

namespace smartmill::sim {

/// A half-sine blow (Dunwoody section 4.3.1).
struct Blow {
  double begin = 0.0;    ///< [s]
  double peak = 0.0;     ///< [N]
  double contact = 0.0;  ///< [s] > 0

  double force(double time) const;  ///< [N]
  bool over(double time) const { return time > begin + contact; }
};

/// Automatic hammer and capacitive displacement sensor on the table, as the standing tool meets them
/// (Dunwoody fig. 4.1): V = gain (g0 / gap - 1), clipped; the gap opens with the vibration and where the
/// tool's surface falls back between two flutes.
class HammerStation {
 public:
  /// @throws Error when stickout and offset contradict each other.
  HammerStation(const smartmill::HammerStation& station, const ToolGeometry& tool,
                std::optional<double> stickout);

  /// The axis (0 x, 1 y) whose sensor and hammer the tool stands before.
  std::optional<std::size_t> facing(const std::array<double, 3>& position) const;

  /// Voltage without noise [V]; -range away from both sensors.
  /// @param angle [rad] of tooth 1 @param displacement [m] of the tip in x and y
  double voltage(const std::array<double, 3>& position, double angle,
                 const std::array<double, 2>& displacement) const;

  /// [N] force at the tip that moves it as a blow of `force` at the hammer's height does: the bending line of
  /// a cantilever, l^2 (3 L - l) / (2 L^3) with l = L - offset (eq. 4.43). The blow comes from the sensor's
  /// side.
  double atTip(double force) const { return -shape_ * force; }

  double clipped(double voltage) const;

 private:
  double retreat(double angle, double facing) const;

  smartmill::HammerStation station_;
  ToolGeometry tool_;
  double shape_ = 1.0;
};

}  // namespace smartmill::sim
