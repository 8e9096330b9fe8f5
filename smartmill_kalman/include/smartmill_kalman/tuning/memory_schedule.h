#pragma once

#include <array>
#include <cstddef>
#include <optional>
#include <string>
#include <vector>

namespace smartmill {
class StrictYaml;
}

namespace smartmill::kalman {

/// Process noise of one axis at one spindle speed, and the force error that it leaves.
struct TunedMemory {
  double speed = 0.0;  ///< [rad/s]
  /// [revolutions] tau of q = r dt / tau^2, the same for all harmonics; empty: the fixed design is not worse
  std::optional<double> memory;
  double error = 0.0;        ///< [N] RMS expected with it
  double fixed_error = 0.0;  ///< [N] RMS expected with the fixed design
};

/// Process noise over the spindle speed (Burzoni 6.2), each axis x, y, z by ascending speed.
struct MemorySchedule {
  std::array<std::vector<TunedMemory>, 3> axis;

  bool empty() const { return axis[0].empty(); }
  /// Interpolated over the logarithm of the speed. Empty, i.e. the fixed design: outside the tuned speeds,
  /// and next to a speed at which it is not worse. @param speed [rad/s]
  std::optional<double> memory(std::size_t axis, double speed) const;
  /// Expected RMS force error [N], interpolated likewise; empty outside the tuned speeds.
  std::optional<double> error(std::size_t axis, double speed) const;
};

/// One line: speeds, expected errors with the tuned and the fixed design.
std::string describe(const MemorySchedule& schedule);

/// Section memory_over_speed of a file. @throws Error naming file and key.
MemorySchedule readMemorySection(const StrictYaml& section);
std::string memorySection(const MemorySchedule& schedule);

/// Reads and writes a smartmill-memory/1 file. @throws Error of one line naming file and key.
MemorySchedule readMemorySchedule(const std::string& file);
void writeMemorySchedule(const MemorySchedule& schedule, const std::string& file);

}  // namespace smartmill::kalman
