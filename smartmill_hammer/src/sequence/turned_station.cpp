#include "turned_station.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>

#include "smartmill_core/error.h"
#include "smartmill_core/modal/modal_fit.h"
#include "smartmill_core/modal/modal_model.h"

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

/// Standard deviations of a mode as measured along an axis of the station; zero: not seen along it.
Mode nearest(const ModalModel& model, const Mode& mode) {
  Mode found;
  double least = mode.damping_ratio * mode.frequency;  // half of its width
  for (const Mode& m : model.modes) {
    const double off = std::abs(m.frequency - mode.frequency);
    if (off < least) least = off, found = m;
  }
  return found;
}

/// The errors of sensors, tip correction and scatter along each axis of the station, which the scatter of
/// the lines of their sum does not contain.
void addErrors(const ModalModel& first, const ModalModel& second, double c, double s, ModalModel& model) {
  for (Mode& mode : model.modes) {
    const Mode a = nearest(first, mode), b = nearest(second, mode);
    const double cross = 2.0 * c * s * std::sqrt(a.gain_std * b.gain_std);
    mode.gain_std = std::hypot(mode.gain_std, std::hypot(c * c * a.gain_std, s * s * b.gain_std, cross));
    mode.frequency_std = std::max({mode.frequency_std, a.frequency_std, b.frequency_std});
    mode.damping_ratio_std = std::max({mode.damping_ratio_std, a.damping_ratio_std, b.damping_ratio_std});
  }
}

}  // namespace

MeasureFrfResult alongMachineAxis(const MeasureFrfResult& first, const MeasureFrfResult& second, double angle,
                                  int modes, const HammerParameters& parameters) {
  MeasureFrfResult result = first;
  result.frf.stamp = result.modes.stamp = result.cross.stamp = second.frf.stamp;
  result.measured_frf = {};
  result.measured = {};
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
    addErrors(first.modes.model, second.modes.model, c, s, fit.model);
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
