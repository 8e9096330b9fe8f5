#include "hammer/offset_cases.h"

#include <algorithm>
#include <cmath>
#include <complex>

#include "plant/drawn_spindle.h"
#include "smartmill_hammer/analysis/offset_factor.h"

namespace smartmill::studies {
namespace {

using Complex = std::complex<double>;
constexpr double STEP = 10.0, LAST = 5500.0, HIGH = 5000.0;  // [Hz]
constexpr double ALL_MODES = 1e5;                            // [Hz] of the plant's beam
/// Matching distance of found and true mode; a mode predicted only by the beam model may be farther off.
constexpr double SAME = 0.01, SAME_UNSEEN = 0.1;

double between(std::mt19937_64& random, double low, double high) {
  return std::uniform_real_distribution<double>(low, high)(random);
}
double about(std::mt19937_64& random, double value, double std) {
  return value + std * std::normal_distribution<double>()(random);
}

/// 100 .. 5000 Hz
double errorOf(const FrequencyResponse& frf, const FrequencyResponse& truth) {
  double off = 0.0, all = 0.0;
  for (std::size_t i = 0; i < frf.size(); ++i) {
    if (frf.frequency[i] < 100.0 || frf.frequency[i] > HIGH) continue;
    off += std::norm(frf.value[i] - truth.value[i]);
    all += std::norm(truth.value[i]);
  }
  return std::sqrt(off / all);
}

const Mode* nearest(const std::vector<Mode>& modes, double frequency, double within) {
  const Mode* found = nullptr;
  for (const Mode& m : modes) {
    const double off = std::abs(m.frequency - frequency);
    if (off < within * frequency && (!found || off < std::abs(found->frequency - frequency))) found = &m;
  }
  return found;
}

std::vector<GainError> errorsOf(const std::vector<Mode>& modes, const std::vector<plant::CrossMode>& truth,
                                double within) {
  double largest = 0.0;
  for (const plant::CrossMode& t : truth) largest = std::max(largest, t.gain);
  std::vector<GainError> errors;
  for (const plant::CrossMode& t : truth) {
    GainError e{t.frequency, t.gain / largest, 1.0, 0.0};
    if (const Mode* m = nearest(modes, t.frequency, within)) {
      e.error = m->gain / t.gain - 1.0;
      e.std = std::isfinite(m->gain_std) ? m->gain_std / t.gain : 0.0;
    }
    errors.push_back(e);
  }
  return errors;
}

}  // namespace

OffsetCase drawOffsetCase(std::mt19937_64& random) {
  OffsetCase c;
  hammer::ToolBeam& b = c.believed;
  plant::ToolInSpindle& t = c.truth;
  const bool carbide = between(random, 0.0, 1.0) < 0.7;
  const double diameter = between(random, 8e-3, 20e-3);
  const double length = std::max(0.035, diameter * between(random, 3.0, 6.5));
  b.stickout = {length, 0.5e-3};
  b.diameter = {diameter, 0.02e-3};
  b.fluted_length = {length * between(random, 0.4, 0.8), 1e-3};
  b.flute_ratio = {0.81, 0.03};
  b.young = carbide ? hammer::UncertainValue{5.8e11, 1.5e10} : hammer::UncertainValue{2.1e11, 5e9};
  b.density = carbide ? hammer::UncertainValue{14300.0, 200.0} : hammer::UncertainValue{7850.0, 50.0};
  t.stickout = about(random, length, b.stickout.std);
  t.shank_diameter = about(random, diameter, b.diameter.std);
  t.fluted_length = about(random, b.fluted_length.value, b.fluted_length.std);
  t.flute_ratio = between(random, 0.76, 0.86);
  t.young = about(random, b.young.value, b.young.std);
  t.density = about(random, b.density.value, b.density.std);
  plant::drawSpindle(random, t);
  c.offset = between(random, 10e-3, 18e-3);
  return c;
}

FrequencyResponse crossFrf(const plant::ToolInSpindle& tool, double struck, double read, double noise,
                           std::mt19937_64& random) {
  FrequencyResponse frf;
  frf.unit = "m/N";
  frf.averages = 5;
  const std::vector<plant::CrossMode> modes = plant::crossModes(tool, struck, read, ALL_MODES);
  double power = 0.0;
  for (double f = 2.0 * STEP; f <= LAST; f += STEP) {
    Complex value;
    for (const plant::CrossMode& m : modes) {
      const double r = f / m.frequency;
      value += m.gain / Complex(1.0 - r * r, 2.0 * tool.damping_ratio * r);
    }
    frf.frequency.push_back(f);
    frf.value.push_back(value);
    power += std::norm(value);
  }
  const double std = noise * std::sqrt(power / static_cast<double>(frf.size()));
  std::normal_distribution<double> normal(0.0, 1.0);
  for (Complex& v : frf.value) v += std * std::sqrt(0.5) * Complex(normal(random), normal(random));
  frf.std_dev.assign(frf.size(), std::max(std, 1e-30));
  return frf;
}

std::string nameOf(TipMethod method) {
  constexpr const char* NAMES[TIP_METHODS] = {"none", "eq. 4.44", "receptance coupling",
                                              "the same, two heights"};
  return NAMES[static_cast<int>(method)];
}

OffsetOutcome judgeOffset(const OffsetCase& drawn, double noise, std::mt19937_64& random) {
  const double offset = drawn.offset;
  const FrequencyResponse low = crossFrf(drawn.truth, offset, 0.0, noise, random);
  const FrequencyResponse high = crossFrf(drawn.truth, 2.0 * offset, offset, noise, random);
  ModalFitOptions options;
  options.low = 100.0;
  options.high = LAST - STEP;
  const ModalModel at_tip = fitModes(low, options).model, above = fitModes(high, options).model;
  const hammer::TipCorrection one = hammer::correctToTip({{offset, 0.0, at_tip}}, drawn.believed, {}, HIGH);
  const hammer::TipCorrection two =
      hammer::correctToTip({{offset, 0.0, at_tip}, {2.0 * offset, offset, above}}, drawn.believed, {}, HIGH);
  const double factor = hammer::offsetFactor(drawn.believed.stickout.value, offset);
  std::vector<Mode> thesis = at_tip.modes;
  for (Mode& m : thesis) m.gain *= factor;

  OffsetOutcome outcome;
  outcome.truth = crossFrf(drawn.truth, 0.0, 0.0, 0.0, random);
  const std::vector<plant::CrossMode> truth = plant::crossModes(drawn.truth, 0.0, 0.0, HIGH);
  outcome.modes[0] = errorsOf(at_tip.modes, truth, SAME);
  outcome.modes[1] = errorsOf(thesis, truth, SAME);
  outcome.modes[2] = errorsOf(one.model().modes, truth, SAME_UNSEEN);
  outcome.modes[3] = errorsOf(two.model().modes, truth, SAME_UNSEEN);
  outcome.frf[0] = outcome.frf[1] = low;
  for (Complex& v : outcome.frf[1].value) v *= factor;
  outcome.frf[2] = hammer::tipResponse(low, one);
  outcome.frf[3] = hammer::tipResponse(low, two);
  for (int w = 0; w < TIP_METHODS; ++w) outcome.frf_error[w] = errorOf(outcome.frf[w], outcome.truth);
  return outcome;
}

}  // namespace smartmill::studies
