#include "smartmill_kalman/compensation/coupled_compensation.h"

#include <algorithm>
#include <utility>

#include "smartmill_core/error.h"

namespace smartmill::kalman {

CoupledCompensation::CoupledCompensation(const CompensationParameters& parameters, const SensorMatrix& matrix,
                                         ForceOutputs outputs)
    : HarmonicCompensation(parameters, std::move(outputs)), matrix_(matrix) {
  if (parameters.lag > 0.0) throw Error("lag: above 0, expected 0 with a sensor matrix");
  if (parameters.delay_form) throw Error("delay_form: true, expected false with a sensor matrix");
}

void CoupledCompensation::couple(const std::vector<HarmonicFilter>& filters, std::array<double, 3>& force) {
  inverse_->add(filters, force);
}

void CoupledCompensation::onFiltersChanged(const std::vector<HarmonicFilter>& filters, double sample_rate) {
  int harmonics = filters[0].pairs().harmonics();
  for (std::size_t axis = 0; axis < 3; ++axis) {
    matrix_.h[axis][axis] = sensor(axis);
    harmonics = std::min(harmonics, filters[axis].pairs().harmonics());
  }
  inverse_.emplace(matrix_, filters[0].pairs().spindleSpeed(), sample_rate, harmonics);
}

}  // namespace smartmill::kalman
