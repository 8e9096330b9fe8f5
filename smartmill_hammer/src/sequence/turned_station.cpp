#include "turned_station.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>

#include "smartmill_core/error.h"
#include "smartmill_core/modal/modal_fit.h"

namespace smartmill::hammer {
namespace {

/// Sum of FRFs with these weights [1], on the lines of the first.
FrequencyResponse weightedSum(const std::array<const FrequencyResponse*, 4>& frfs,
                              const std::array<double, 4>& weights) {
  FrequencyResponse sum = *frfs[0];
  sum.coherence.clear();
  for (std::size_t k = 0; k < sum.size(); ++k) {
    sum.value[k] = 0.0;
    double variance = 0.0;
    for (std::size_t i = 0; i < frfs.size(); ++i) {
      if (k >= frfs[i]->size() || frfs[i]->frequency[k] != sum.frequency[k])
        throw Error("FRFs of the station's axes have different lines");
      sum.value[k] += weights[i] * frfs[i]->value[k];
      variance += std::pow(weights[i] * frfs[i]->std_dev[k], 2);
    }
    sum.std_dev[k] = std::sqrt(variance);
  }
  return sum;
}

}  // namespace

MeasureFrfResult alongMachineAxis(const MeasureFrfResult& first, const MeasureFrfResult& second, double angle,
                                  int modes, const HammerParameters& parameters) {
  MeasureFrfResult result = first;
  result.frf.stamp = result.modes.stamp = result.cross.stamp = second.frf.stamp;
  result.measured_frf = {};
  result.measured = {};
  if (first.cross.frf.size() == 0 || second.cross.frf.size() == 0) {
    result.code = FrfCode::bad_data;
    result.message = "no cross FRF: frames.hammer is turned, the receptance along " + first.frf.direction +
                     " follows from the station's direct and cross FRFs";
    return result;
  }
  // Along x from the station's x and y, along y from its y and x: the machine's axis is turned by the angle
  // from the station's own, and its other axis is on the other side.
  const double c = std::cos(angle), s = first.frf.direction == "x" ? std::sin(angle) : -std::sin(angle);
  const std::array<const FrequencyResponse*, 4> frfs{
      {&first.frf.frf, &second.frf.frf, &first.cross.frf, &second.cross.frf}};
  try {
    result.frf.frf = weightedSum(frfs, {{c * c, s * s, -c * s, -c * s}});
    const double half = 0.5 * (c * c - s * s);
    result.cross.frf = weightedSum(frfs, {{c * s, -c * s, half, half}});
    ModalFitOptions options;
    options.low = parameters.fit_low;
    options.high = parameters.fit_high;
    options.modes = modes;
    options.max_modes = parameters.max_modes;
    options.positive_gains = true;
    ModalFit fit = fitModes(result.frf.frf, options);
    result.modes.model = fit.model;
    result.modes.relative_error = fit.relative_error;
    result.message = first.message + "; " + second.frf.direction + ": " + second.message + "; turned into " +
                     "the machine's axes: " + std::to_string(fit.model.modes.size()) + " modes";
  } catch (const Error& error) {
    result.code = FrfCode::fit_failed;
    result.message = error.what();
  }
  return result;
}

}  // namespace smartmill::hammer
