#include <algorithm>
#include <cmath>

#include "search/probes/mode_scan.h"
#include "search/probes/probe_family.h"

namespace smartmill::discrepancy {
namespace {

struct SensorModeOptions {
  double lowest = LOWEST_MODE;   ///< [Hz]
  double highest = USABLE_BAND;  ///< [1] of the sample rate
  double ratio = 1.06;           ///< [1] of neighbouring frequencies
  double damping_ratio = TYPICAL_DAMPING;
  double gain = 0.01;  ///< [1] at which the derivative is taken: well within the linear range
};

/// One more mode of the force sensor along an axis.
class SensorModes : public ProbeFamily {
 public:
  explicit SensorModes(const ProbeContext& context) : context_(context) {}

  Probes probesOf(const Hypothesis& h) override {
    const auto axis = static_cast<std::size_t>(h.variant.front() - 'x');
    double rate = 0.0;
    for (const TestData& t : context_.runner.data().tests) rate = std::max(rate, t.test.sample_rate);
    const ModeScanOptions scan{options_.lowest, options_.highest * rate, options_.ratio,
                               options_.damping_ratio};
    const auto columns = [&](const std::vector<double>& at) {
      return context_.modes.sensorModes(axis, at, scan.damping_ratio);
    };
    Probes found;
    for (const double f : bestFrequencies(context_.projection, context_.runner.threads(), columns, scan)) {
      const double d = std::log(scan.damping_ratio);
      found.push_back({{std::log(f), d, 0.0}, {{std::log(f), d, options_.gain}}, false});
    }
    return found;
  }

 private:
  const ProbeContext& context_;
  SensorModeOptions options_;
};

}  // namespace

std::unique_ptr<ProbeFamily> makeSensorModes(const ProbeContext& context) {
  return std::make_unique<SensorModes>(context);
}

}  // namespace smartmill::discrepancy
