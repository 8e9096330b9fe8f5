#pragma once

#include <array>
#include <vector>

#include "smartmill_core/units.h"
#include "smartmill_sim/controller/controller_options.h"

namespace smartmill::sim {

constexpr double MM_PER_MIN = units::MM / 60.0;  ///< [m/s]

/// State behind the diagnosis numbers.
struct DiagnosisState {
  bool waits_for_m = false, moves = false, dwells = false, at_zero_feed = false;
  double spindle_load = 0.0;                          ///< [percent]
  double spindle_angle = 0.0;                         ///< [rad]
  std::array<double, 3> axis_temperature{{0, 0, 0}};  ///< [deg C] motor and encoder
  double spindle_temperature = 0.0;                   ///< [deg C]
};

/// Parameters of a 30i that follow from the machine's options.
std::vector<focas::NumberedValue> machineParameters(const ControllerOptions& options);
/// Diagnosis numbers of a 30i for a state.
std::vector<focas::NumberedValue> machineDiagnoses(const DiagnosisState& state);

/// Those with numbers from first to last.
std::vector<focas::NumberedValue> within(std::vector<focas::NumberedValue> numbers, int first, int last);

}  // namespace smartmill::sim
