#pragma once

#include <array>
#include <map>
#include <optional>

namespace smartmill::sim {

/// Macro variables: local #1..#33, common #100..#199 and #500..#999, #1133 (angle of M119), work offsets
/// #5221..#5323 (mm, 20 numbers per system), and read-only positions of x, y, z (mm): #5001.. end of the last
/// block, #5021.. machine, #5041.. workpiece.
class Variables {
 public:
  using Point = std::array<double, 3>;
  static constexpr int VACANT = 0;  // readable, without a value
  static constexpr std::size_t SYSTEMS = 6;

  /// Present positions [m].
  struct Positions {
    Point end{{0, 0, 0}}, machine{{0, 0, 0}}, work{{0, 0, 0}};
  };

  std::array<Point, SYSTEMS> offsets{};  ///< [m] machine minus workpiece position, of G54..G59

  static bool exists(int number);
  static bool writable(int number);
  std::optional<double> read(int number, const Positions& positions) const;
  /// Writes a writable variable; nullopt: vacant (an offset becomes 0).
  void write(int number, std::optional<double> value);
  void clearLocals();

 private:
  std::map<int, double> values_;  // those not vacant
};

}  // namespace smartmill::sim
