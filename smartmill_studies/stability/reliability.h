#pragma once

#include <array>
#include <functional>
#include <vector>

#include "smartmill_core/model/machine_model.h"
#include "smartmill_stability/chart/uncertainty.h"
#include "stability/study_range.h"

namespace smartmill::stability {

/// The model with the dynamics and coefficients of a drawn system: modes of x, then of y.
MachineModel machineOf(const MachineModel& model, const RegenerativeSystem& drawn);

struct ReliabilityOptions : StudyRange {
  int machines = 200;
  int draws = 200;      ///< [1] per prediction
  bool by_twin = true;  ///< one simulated cut per machine
};

/// One machine drawn from the model, with a cut at a random speed near the limit of the model.
struct ReliabilityPoint {
  double speed = 0.0, depth = 0.0;  ///< [rad/s], [m]
  double predicted = 0.0;           ///< [1] probability of chatter by the model
  bool chatters = false;            ///< of the drawn machine by the solver
  bool observed_chatter = false;    ///< and by the simulator
};

/// Predicted and observed share in one bin.
struct ReliabilityBin {
  int count = 0;
  double predicted = 0.0;        ///< [1] mean
  double observed = 0.0;         ///< [1] share
  double low = 0.0, high = 1.0;  ///< [1] Wilson's 95 % interval of the observed share
  bool holds() const { return count == 0 || (predicted >= low && predicted <= high); }
};

/// Machines drawn from the standard deviations of the model, with one cut each.
std::vector<ReliabilityPoint> reliabilityStudy(const MachineModel& model, const RegenerativeSystem& system,
                                               const ReliabilityOptions& options,
                                               const std::function<void(double)>& progress = {});

/// Bins of equal width in the predicted probability. @param by_twin observed: observed_chatter, else chatters
std::vector<ReliabilityBin> reliabilityBins(const std::vector<ReliabilityPoint>& points, int bins,
                                            bool by_twin);

/// Standard score of the number of chattering machines relative to the sum of the predictions: 0 +- 1 if
/// calibrated.
double reliabilityScore(const std::vector<ReliabilityPoint>& points, bool by_twin);

/// Wilson's interval of a share k of n at 95 %.
std::array<double, 2> wilson(int k, int n);

}  // namespace smartmill::stability
