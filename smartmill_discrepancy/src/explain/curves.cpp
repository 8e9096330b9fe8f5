#include <algorithm>
#include <cmath>

#include "smartmill_core/signal/fourier.h"
#include "smartmill_core/units.h"
#include "smartmill_discrepancy/explain/outcome.h"

namespace smartmill::discrepancy {
namespace {

double squaresOf(const std::vector<double>& v, const ChannelSpan& b) {
  double s = 0.0;
  for (std::size_t i = b.offset; i < b.offset + b.size; ++i) s += v[i] * v[i];
  return s / static_cast<double>(b.size);
}

RevolutionCurve overRevolution(const TwinRunner& runner, const ChannelSpan& span,
                               const std::vector<double>& before, const std::vector<double>& after) {
  constexpr std::size_t BINS = 180;  // of a picture: two degrees each
  const TestData& test = runner.data().tests[span.test];
  RevolutionCurve curve{test.test.name, span.channel, {}, {}, {}, {}};
  std::vector<double> count(BINS, 0.0), measured(BINS, 0.0), nominal(BINS, 0.0), improved(BINS, 0.0);
  const std::vector<double>& angle = test.record.column("spindle_angle");
  // Without the initial transient of the sensor.
  for (std::size_t i = test.steadyBegin(); i < span.size; ++i) {
    const auto bin = std::min(BINS - 1, static_cast<std::size_t>(angle[i] / units::TWO_PI * BINS));
    const double m = runner.measured()[span.offset + i];
    count[bin] += 1.0;
    measured[bin] += m;
    nominal[bin] += m - before[span.offset + i];
    improved[bin] += m - after[span.offset + i];
  }
  for (std::size_t b = 0; b < BINS; ++b) {
    if (count[b] == 0.0) continue;
    const double scale = span.noise / count[b];
    curve.angle_deg.push_back((static_cast<double>(b) + 0.5) * 360.0 / BINS);
    curve.measured.push_back(measured[b] * scale);
    curve.nominal.push_back(nominal[b] * scale);
    curve.improved.push_back(improved[b] * scale);
  }
  return curve;
}

}  // namespace

void addCurves(const TwinRunner& runner, const std::vector<double>& before, const std::vector<double>& after,
               Explanation* explanation) {
  for (const char* channel : {"fx", "fy", "fz", "load_meter", "tool_x", "tool_y"}) {
    const ChannelSpan *worst = nullptr, *worst_cut = nullptr;
    for (const ChannelSpan& b : runner.spans()) {
      if (b.channel != channel || b.slow || !b.in_gap) continue;
      const TestData& test = runner.data().tests[b.test];
      if (!worst || squaresOf(before, b) > squaresOf(before, *worst)) worst = &b;
      if (test.test.kind == TestKind::cut && test.record.has("spindle_angle") &&
          (!worst_cut || squaresOf(before, b) > squaresOf(before, *worst_cut)))
        worst_cut = &b;
    }
    if (worst_cut) explanation->revolutions.push_back(overRevolution(runner, *worst_cut, before, after));
    if (!worst) continue;
    const TestData& test = runner.data().tests[worst->test];
    SpectrumCurve s;
    s.test = test.test.name;
    s.channel = channel;
    s.order_hz = test.test.spindle_speed / units::TWO_PI;
    const auto b = fourier(valuesOf(before, *worst)), a = fourier(valuesOf(after, *worst));
    const double scale = 2.0 * worst->noise / static_cast<double>(worst->size);
    const std::vector<double> f = fourierFrequencies(worst->size, test.test.sample_rate);
    for (std::size_t k = 1; k < b.size() && f[k] < HIGHEST_PICTURED; ++k) {
      s.frequency_hz.push_back(f[k]);
      s.before.push_back(scale * std::abs(b[k]));
      s.after.push_back(scale * std::abs(a[k]));
    }
    explanation->spectra.push_back(std::move(s));
  }
}

}  // namespace smartmill::discrepancy
