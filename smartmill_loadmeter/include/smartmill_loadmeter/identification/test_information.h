#pragma once

#include <cstddef>
#include <optional>
#include <vector>

#include "smartmill_core/cutting/tool.h"
#include "smartmill_core/model/machine_model.h"
#include "smartmill_core/signal/streams.h"
#include "smartmill_loadmeter/identification/cut_information.h"

namespace smartmill::loadmeter {

/// [V] standard deviation of a test's mean voltage: the resolution of the thesis' load meter (eq. 3.12).
constexpr double TYPICAL_VOLTAGE_STD = 3e-4;

/// Covariance of Ktc and Kte that air cuts and cuts will have together with earlier knowledge: eq. 3.19 and
/// 3.12, with Coulomb and viscous friction of the spindle determined by the same tests.
/// @param prior nullptr: none. @param voltage_std [V] of one test's mean voltage
TorqueCovariance expectedCovariance(const std::vector<CuttingCondition>& tests, const Spindle& spindle,
                                    const TorqueCovariance* prior, double voltage_std = TYPICAL_VOLTAGE_STD);

/// Indices, in order, of the fewest of the planned tests that, with the knowledge, make Ktc and Kte as
/// certain as all tests would without it. Two air cuts of different speeds, which enclose those of the cuts,
/// and two cuts of different feeds remain and check the knowledge. Everything is needed if the tests have
/// fewer.
std::vector<std::size_t> neededTests(const std::vector<CuttingCondition>& tests, const Spindle& spindle,
                                     const TorqueCovariance& knowledge,
                                     double voltage_std = TYPICAL_VOLTAGE_STD);

/// A cut that reduces the uncertainty of what is known.
struct SuggestedCut {
  double speed = 0.0;  ///< [rad/s]
  Engagement engagement;
  double ktc_std = 0.0, kte_std = 0.0;  ///< [N/m2], [N/m] expected after it and an air cut at its speed
  double torque = 0.0;                  ///< [N m] expected mean
};

/// Conditions that a suggested cut may have.
struct SuggestionLimits {
  double slowest = 0.0, fastest = 0.0;         ///< [rad/s]
  double least_feed = 0.0, most_feed = 0.0;    ///< [m] per tooth
  double least_depth = 0.0, most_depth = 0.0;  ///< [m]
  double torque = 0.0, power = 0.0;            ///< [N m], [W]; 0: unlimited
};

/// The cut, as slot or half immersion in up and down milling, after which the sum of the relative variances
/// of Ktc and Kte is smallest. Empty: none within the limits.
std::optional<SuggestedCut> mostInformativeCut(const ToolGeometry& tool, const Spindle& spindle,
                                               const CuttingCoefficients& value,
                                               const TorqueCovariance& knowledge,
                                               const SuggestionLimits& limits,
                                               double voltage_std = TYPICAL_VOLTAGE_STD);

}  // namespace smartmill::loadmeter
