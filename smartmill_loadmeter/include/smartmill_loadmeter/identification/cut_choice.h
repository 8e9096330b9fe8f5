#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "smartmill_core/cutting/tool.h"
#include "smartmill_core/model/machine_model.h"
#include "smartmill_core/signal/streams.h"
#include "smartmill_loadmeter/identification/cut_information.h"
#include "smartmill_loadmeter/identification/load_test.h"

namespace smartmill::loadmeter {

/// Readings of the load meter, which determine the standard deviation of the mean of a test.
struct LoadMeterReadings {
  double noise = 0.0;     ///< [V] standard deviation of the mean of n readings times the root of n
  double rounding = 0.0;  ///< [V] rounding error of a level, which averaging does not reduce
  double period = 0.02;   ///< [s] between two readings
  double settling = 0.0;  ///< [s] of a steady part without readings
  double air_time = 1.0;  ///< [s] of the readings of an air cut

  /// [V] of the mean of a test, see meanVoltage(). @param time [s] of its readings
  double voltageStd(double time) const;
};

/// As the air cuts of a session show them. Without air cuts with readings a reading has the noise of its
/// resolution. @param settling [s] of IdentificationParameters
LoadMeterReadings readingsOf(const std::vector<LoadTest>& air_cuts, const Spindle& spindle, double settling);

/// Time [s] of the feed between steady_from and steady_to.
double steadyTime(const CuttingCondition& cut);

/// A cut that a session may make.
struct CandidateCut {
  CuttingCondition condition;
  double cutting_time = 0.0;  ///< [s] of feed, with entry and exit
  double stock = 0.0;         ///< [m] width of the stock that it uses
  double depth_limit = 0.0;   ///< [m] stability limit at its speed and immersion; 0: unknown
};

/// What the chosen cuts shall reach, and within which limits.
struct ChoiceGoal {
  double ktc_std = 0.0, kte_std = 0.0;  ///< [N/m2], [N/m] expected after the cuts
  double stock = 0.0;                   ///< [m] width available
  CuttingCoefficients highest;          ///< Ktc and Kte for the torque
  double torque = 0.0, power = 0.0;     ///< [N m], [W] mean of a cut; 0: unlimited
  double depth_margin = 0.2;            ///< [1] below a known stability limit, as that of recommended cuts
  std::size_t least_feeds = 3;          ///< feeds among all cuts, which show a bent line
  std::vector<double> feeds_made;       ///< [m] of the cuts that are made already
};

struct ChosenCut {
  std::size_t candidate = 0;            ///< index
  double gain = 0.0;                    ///< [nat] information gain, see CutInformation::entropy()
  double gain_per_second = 0.0;         ///< [1/s] of cutting
  double ktc_std = 0.0, kte_std = 0.0;  ///< [N/m2], [N/m] expected after it
};

struct CutChoice {
  std::vector<ChosenCut> cuts;        ///< in order
  bool reached = false;               ///< the standard deviations
  std::vector<std::string> excluded;  ///< candidates beyond a limit, each with the reason
};

/// The cuts with the largest information gain per second of cutting, one after the other, until the expected
/// standard deviations are reached; then cuts are dropped or exchanged as long as this saves time.
/// @param known air cuts, cuts already made and earlier knowledge. Ktc and Kte must not be unknown: without
/// earlier knowledge add withoutKnowledge().
CutChoice chooseCuts(const CutInformation& known, const std::vector<CandidateCut>& candidates,
                     const LoadMeterReadings& readings, const Spindle& spindle, const ChoiceGoal& goal);

/// Covariance of Ktc and Kte of any metal: the start of RecursiveCoefficients.
TorqueCovariance withoutKnowledge();

}  // namespace smartmill::loadmeter
