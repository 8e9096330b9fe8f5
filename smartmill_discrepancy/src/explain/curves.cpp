#include <algorithm>
#include <cmath>
#include <numeric>

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

SpectrumCurve spectrumOf(const TwinRunner& runner, const ChannelSpan& span, const std::vector<double>& before,
                         const std::vector<double>& after) {
  const CampaignTest& test = runner.data().tests[span.test].test;
  SpectrumCurve s;
  s.test = test.name;
  s.channel = span.channel;
  s.order_hz = test.spindle_speed / units::TWO_PI;
  const auto b = fourier(valuesOf(before, span)), a = fourier(valuesOf(after, span));
  const double scale = 2.0 * span.noise / static_cast<double>(span.size);
  const std::vector<double> f = fourierFrequencies(span.size, test.sample_rate);
  for (std::size_t k = 1; k < b.size() && f[k] < HIGHEST_PICTURED; ++k) {
    s.frequency_hz.push_back(f[k]);
    s.before.push_back(scale * std::abs(b[k]));
    s.after.push_back(scale * std::abs(a[k]));
  }
  return s;
}

}  // namespace

void addCurves(const TwinRunner& runner, const std::vector<double>& before, const std::vector<double>& after,
               Explanation* explanation) {
  for (const char* channel : {"fx", "fy", "fz", "load_meter", "tool_x", "tool_y"}) {
    const ChannelSpan* worst = nullptr;
    for (const ChannelSpan& b : runner.spans()) {
      if (b.channel == channel && !b.slow && b.in_gap &&
          (!worst || squaresOf(before, b) > squaresOf(before, *worst)))
        worst = &b;
    }
    if (worst) explanation->spectra.push_back(spectrumOf(runner, *worst, before, after));
  }
  // The cut with the largest residual of the forces first.
  std::vector<double> residual(runner.data().tests.size(), 0.0);
  std::vector<std::vector<const ChannelSpan*>> spans(residual.size());
  for (const ChannelSpan& b : runner.spans()) {
    const TestData& test = runner.data().tests[b.test];
    if (b.slow || !b.in_gap || test.test.kind != TestKind::cut || !test.record.has("spindle_angle")) continue;
    residual[b.test] = std::max(residual[b.test], squaresOf(before, b));
    spans[b.test].push_back(&b);
  }
  std::vector<std::size_t> order(residual.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::stable_sort(order.begin(), order.end(),
                   [&](std::size_t i, std::size_t j) { return residual[i] > residual[j]; });
  for (const std::size_t test : order) {
    for (const ChannelSpan* span : spans[test])
      explanation->revolutions.push_back(overRevolution(runner, *span, before, after));
  }
}

}  // namespace smartmill::discrepancy
