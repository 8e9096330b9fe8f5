#pragma once

#include <functional>
#include <vector>

#include "smartmill_core/model/machine_model.h"
#include "smartmill_stability/solvers/solver.h"
#include "stability/study_range.h"
#include "stability/twin_cuts.h"

namespace smartmill::stability {

struct AgreementOptions : StudyRange {
  double band = 0.05;    ///< [1] of the depth, excluded around the boundary
  double feed = 0.1e-3;  ///< [m] per tooth
  int points = 400;
  int revolutions = 180;  ///< [1] in cut

  /// @throws Error naming the quantity.
  void validate() const;
};

struct AgreementPoint {
  double speed = 0.0;   ///< [rad/s]
  double depth = 0.0;   ///< [m]
  double radius = 0.0;  ///< [1] of the dominant multiplier
  double limit = 0.0;   ///< [m] first loss of stability at this speed
  Kind kind = Kind::none;
  bool observed_chatter = false;  ///< the simulated record chatters
  bool chatters() const { return radius > 1.0; }
  bool agrees() const { return chatters() == observed_chatter; }
};

/// Once-per-period sampling of a record of a steady cut: whether the part that does not repeat with a period
/// [samples] persists or grows over the second half. @param scale [m] a twentieth of it counts as persistent,
/// a thousandth as decayed.
bool repeatsNoMore(const Record& record, int samples, int period, double scale);

/// Random points outside the band, uniform in speed and in depth over the first limit (0.4 .. 1.6): stability
/// by the default solver and by the simulated records.
/// @param system of the model (helix, pitch, arc); with a chip geometry its contact is used; the first
/// limits, from which points are drawn, are those without it (for speed)
std::vector<AgreementPoint> agreementWithTwin(const MachineModel& model, const RegenerativeSystem& system,
                                              const AgreementOptions& options,
                                              const std::function<void(double)>& progress = {});

}  // namespace smartmill::stability
