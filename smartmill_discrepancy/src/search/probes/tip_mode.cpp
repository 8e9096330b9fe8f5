#include <cmath>

#include "search/probes/mode_scan.h"
#include "search/probes/probe_family.h"

namespace smartmill::discrepancy {
namespace {

struct TipModeOptions {
  double lowest = 200.0, highest = 6000.0;  ///< [Hz] searched
  double ratio = 1.08;                      ///< [1] of neighbouring frequencies
  double damping_ratio = 0.05;              ///< [1] assumed; the fit finds the true one
  double otherwise = 1200.0;                ///< [Hz] if no frequency reduces the residual
};

/// Modes of the tool tip along the axes that the variant names.
class TipModes : public ProbeFamily {
 public:
  explicit TipModes(const ProbeContext& context) : context_(context) {}

  Probes probesOf(const Hypothesis& h) override {
    Hypothesis::Probe probe;
    for (const char axis : h.variant) {
      for (const double v : {std::log(frequencyOf(axis)), std::log(options_.damping_ratio), 0.0})
        probe.null.push_back(v);
    }
    for (std::size_t k = 2; k < probe.null.size(); k += 3) addUnitPoint(probe, k);
    return {probe};
  }

 private:
  double frequencyOf(char axis) {
    const auto known = best_.find(axis);
    if (known != best_.end()) return known->second;
    ModeScanOptions scan{options_.lowest, options_.highest, options_.ratio, options_.damping_ratio};
    scan.positive = true;
    scan.found = 1;
    const auto columns = [&](const std::vector<double>& at) {
      return context_.modes.tipModes(axis == 'x' ? 0 : 1, at, scan.damping_ratio);
    };
    const std::vector<double> found =
        bestFrequencies(context_.projection, context_.runner.threads(), columns, scan);
    return best_[axis] = found.empty() ? options_.otherwise : found.front();
  }

  const ProbeContext& context_;
  TipModeOptions options_;
  std::map<char, double> best_;  // frequency [Hz] by axis, computed once
};

}  // namespace

std::unique_ptr<ProbeFamily> makeTipModes(const ProbeContext& context) {
  return std::make_unique<TipModes>(context);
}

}  // namespace smartmill::discrepancy
