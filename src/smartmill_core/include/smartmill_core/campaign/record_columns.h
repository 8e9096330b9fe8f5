#pragma once

#include <array>
#include <cstddef>
#include <optional>
#include <string_view>
#include <vector>

#include "smartmill_core/units.h"

namespace smartmill {

/// A column that a record may have (formats.md section 2).
struct RecordColumn {
  const char* name;
  const char* unit;  ///< in the CSV
  double si;         ///< SI value of one in the CSV
};

inline constexpr std::array<RecordColumn, 21> RECORD_COLUMNS{{{"time", "s", 1.0},
                                                              {"spindle_angle", "rad", 1.0},
                                                              {"fx", "N", 1.0},
                                                              {"fy", "N", 1.0},
                                                              {"fz", "N", 1.0},
                                                              {"load_meter", "V", 1.0},
                                                              {"hammer", "N", 1.0},
                                                              {"tool_x", "um", units::UM},
                                                              {"tool_y", "um", units::UM},
                                                              {"displacement", "m", 1.0},
                                                              {"acceleration", "m/s2", 1.0},
                                                              {"axis_x", "mm", units::MM},
                                                              {"axis_y", "mm", units::MM},
                                                              {"axis_z", "mm", units::MM},
                                                              {"axis_vx", "mm/min", units::MM / 60.0},
                                                              {"axis_vy", "mm/min", units::MM / 60.0},
                                                              {"axis_vz", "mm/min", units::MM / 60.0},
                                                              {"current_x", "A", 1.0},
                                                              {"current_y", "A", 1.0},
                                                              {"current_z", "A", 1.0},
                                                              {"tachometer", "V", 1.0}}};

/// @return nullptr for a name that is not a column
const RecordColumn* recordColumn(std::string_view name);

/// Axis (0: x, 1: y, 2: z) of a column with the position (axis_x) or velocity (axis_vx) of a machine axis;
/// nothing for any other column.
std::optional<std::size_t> motionAxis(std::string_view name);

/// A step between two samples that differs from the others.
struct UnevenStep {
  std::size_t sample = 0;  ///< index of the sample before the step
  double step = 0.0;       ///< [s]
  double usual = 0.0;      ///< [s] median of all steps
};

/// The worst step of an unevenly sampled time axis (the first of equal ones), or nothing. Times are printed
/// with a few digits: a sample may be off the even grid by a quarter of a step; a lost sample moves its
/// neighbours by half a step or more.
std::optional<UnevenStep> unevenStep(const std::vector<double>& time);

}  // namespace smartmill
