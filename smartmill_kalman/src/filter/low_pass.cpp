#include "smartmill_kalman/filter/low_pass.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>

#include "smartmill_core/error.h"
#include "smartmill_core/units.h"

namespace smartmill::kalman {

LowPass::LowPass(double corner, double sample_rate) {
  if (!(corner > 0.0) || !(corner < 0.5 * sample_rate)) {
    throw Error("low pass: corner " + std::to_string(corner) + " Hz, expected 0 .. " +
                std::to_string(0.5 * sample_rate) + " Hz");
  }
  const double k = std::tan(units::PI * corner / sample_rate);
  for (std::size_t i = 0; i < sections_.size(); ++i) {
    // Poles at angles pi/8 and 3 pi/8 off the real axis.
    const double damping = 2.0 * std::cos(units::PI / 8.0 * (2.0 * static_cast<double>(i) + 1.0));
    const double norm = 1.0 / (1.0 + damping * k + k * k);
    Section& s = sections_[i];
    s.b0 = k * k * norm;
    s.b1 = 2.0 * s.b0;
    s.b2 = s.b0;
    s.a1 = 2.0 * (k * k - 1.0) * norm;
    s.a2 = (1.0 - damping * k + k * k) * norm;
    delay_ += (s.b1 + 2.0 * s.b2) / (s.b0 + s.b1 + s.b2) - (s.a1 + 2.0 * s.a2) / (1.0 + s.a1 + s.a2);
  }
}

double LowPass::step(double sample) {
  if (!std::isfinite(sample)) {
    reset();
    return std::numeric_limits<double>::quiet_NaN();
  }
  double value = sample;
  for (Section& s : sections_) {
    if (!started_) {  // steady state at this level
      s.s2 = (s.b2 - s.a2) * value;
      s.s1 = (s.b1 - s.a1) * value + s.s2;
    }
    const double out = s.b0 * value + s.s1;
    s.s1 = s.b1 * value - s.a1 * out + s.s2;
    s.s2 = s.b2 * value - s.a2 * out;
    value = out;
  }
  started_ = true;
  return value;
}

std::vector<double> zeroPhaseLowPass(const std::vector<double>& signal, double corner, double sample_rate) {
  LowPass filter(corner, sample_rate);
  if (signal.empty()) return {};
  const auto ring = static_cast<std::size_t>(3.0 * sample_rate / corner);  // duration of its impulse response
  const std::size_t margin = std::min(signal.size() - 1, ring);
  std::vector<double> longer;
  longer.reserve(signal.size() + 2 * margin);
  for (std::size_t i = margin; i > 0; --i) longer.push_back(2.0 * signal.front() - signal[i]);
  longer.insert(longer.end(), signal.begin(), signal.end());
  for (std::size_t i = 1; i <= margin; ++i)
    longer.push_back(2.0 * signal.back() - signal[signal.size() - 1 - i]);
  for (int pass = 0; pass < 2; ++pass) {
    filter.reset();
    for (double& value : longer) value = filter.step(value);
    std::reverse(longer.begin(), longer.end());
  }
  const auto first = longer.begin() + static_cast<std::ptrdiff_t>(margin);
  return {first, first + static_cast<std::ptrdiff_t>(signal.size())};
}

}  // namespace smartmill::kalman
