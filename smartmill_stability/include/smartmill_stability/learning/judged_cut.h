#pragma once

#include <optional>
#include <string>
#include <vector>

namespace smartmill::stability {

/// A measured value with its standard deviation.
struct Measured {
  double value = 0.0, std_dev = 0.0;
};

/// A cut that was made, and whether it chattered.
struct JudgedCut {
  double speed = 0.0;  ///< [rad/s]
  double depth = 0.0;  ///< [m]
  bool chatter = false;
  std::optional<Measured> frequency =
      std::nullopt;                           ///< [Hz] of the chatter; standard deviation 0: not stated
  std::optional<Measured> kt = std::nullopt;  ///< [N/m2] tangential coefficient, from the load meter
};

/// Cuts of a CSV file with the columns rpm, depth_mm and verdict (stable or chatter); the columns chatter_hz,
/// chatter_std_hz, kt_n_per_mm2 and kt_std_n_per_mm2 may be missing, and their cells empty.
/// @throws Error naming file, line and column.
std::vector<JudgedCut> readJudgedCuts(const std::string& file);

}  // namespace smartmill::stability
