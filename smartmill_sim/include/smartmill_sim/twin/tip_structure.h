#pragma once

#include <array>
#include <cstddef>

#include "smartmill_core/modal/modal_filter.h"
#include "smartmill_core/model/machine_model.h"
#include "smartmill_sim/twin/cutter.h"

namespace smartmill::sim {

/// Response of the tool tip to forces in x and y and of the workpiece to their reaction, in constant time
/// steps.
class TipStructure {
 public:
  using Vector = std::array<double, 2>;

  struct Displacement {
    Vector tool{};      ///< [m] of the tip
    Vector relative{};  ///< [m] of the tip relative to the workpiece
  };

  /// @param rate [Hz] of the steps
  TipStructure(const ToolTip& tip, const WorkpieceModes& workpiece, double rate);
  /// Whether the tip or the workpiece has modes.
  bool vibrates() const { return vibrates_; }

  /// Predicts the motion of the tip relative to the workpiece in the next step from its linearly extrapolated
  /// force, with an error of second order in the step. @param with_rate whether the rate and the mobility are
  /// needed @param external [N] force on the tip that is not cutting force
  TipMobility predict(bool with_rate, const Vector& external, ToolMotion& motion) const;
  /// One step. @param before [N] linear change of the force up to here, then a jump to `force` if `jumps`
  /// @param external [N] as in predict(), in both forces @param extrapolate whether the change of the force
  /// may be extrapolated
  Displacement step(const Vector& before, const Vector& force, const Vector& external, bool jumps,
                    bool extrapolate);
  /// [m/s2] of the tip at the last step.
  double acceleration(std::size_t axis) const { return axis_[axis].acceleration(); }

 private:
  bool vibrates_;
  std::array<ModalFilter, 2> axis_, workpiece_;
  std::array<Vector, 2> force_{};  // [N] one and two steps ago, by axis
};

}  // namespace smartmill::sim
