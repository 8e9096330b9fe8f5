#pragma once

#include <array>
#include <cstddef>

#include "smartmill_core/modal/modal_filter.h"
#include "smartmill_core/model/machine_model.h"
#include "smartmill_sim/twin/cutter.h"

namespace smartmill::sim {

/// Response of the tool tip to forces in x and y, in constant time steps.
class TipStructure {
 public:
  using Vector = std::array<double, 2>;

  /// @param rate [Hz] of the steps
  TipStructure(const ToolTip& tip, double rate);
  /// Whether the tip has modes.
  bool vibrates() const { return vibrates_; }

  /// Predicts the motion of the tip in the next step from its linearly extrapolated force, with an error of
  /// second order in the step. @param with_rate whether the rate and the mobility are needed @param external
  /// [N] force on the tip that is not cutting force
  TipMobility predict(bool with_rate, const Vector& external, ToolMotion& motion) const;
  /// One step. @param before [N] linear change of the force up to here, then a jump to `force` if `jumps`
  /// @param extrapolate whether the change of the force may be extrapolated @return [m]
  Vector step(const Vector& before, const Vector& force, bool jumps, bool extrapolate);
  /// [m/s2] at the last step.
  double acceleration(std::size_t axis) const { return axis_[axis].acceleration(); }

 private:
  bool vibrates_;
  std::array<ModalFilter, 2> axis_;
  std::array<Vector, 2> force_{};  // [N] one and two steps ago, by axis
};

}  // namespace smartmill::sim
