#pragma once

#include <optional>

#include "smartmill_kalman/compensation/harmonic_compensation.h"
#include "smartmill_kalman/filter/coupled_filter.h"

namespace smartmill::kalman {

/// HarmonicCompensation of a sensor with cross-talk: at each harmonic the force is the inverse of the
/// sensor's matrix times the measured harmonics. setSensor() replaces a diagonal element of the matrix.
class CoupledCompensation : public HarmonicCompensation {
 public:
  /// @throws Error with lag or delay_form, which do not support cross-talk. prepare() throws when the matrix
  /// is singular at a harmonic.
  CoupledCompensation(const CompensationParameters& parameters, const SensorMatrix& matrix,
                      ForceOutputs outputs);

 protected:
  bool isCoupled() const override { return true; }
  void couple(const std::vector<HarmonicFilter>& filters, std::array<double, 3>& force) override;
  void onFiltersChanged(const std::vector<HarmonicFilter>& filters, double sample_rate) override;

 private:
  SensorMatrix matrix_;
  std::optional<CrossTalkInverse> inverse_;  // at the speed of the filters
};

}  // namespace smartmill::kalman
