#include "smartmill_stability/coupling/tool_assembly.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <random>

#include <Eigen/Cholesky>

#include "smartmill_core/error.h"
#include "smartmill_core/fit/least_squares.h"
#include "smartmill_core/require.h"
#include "smartmill_core/signal/statistics.h"
#include "smartmill_core/units.h"

namespace smartmill::stability {
namespace {

using Complex = std::complex<double>;
using units::TWO_PI;

struct FitSettings {
  std::size_t most_lines = 300;  ///< of a tapped tool in the fit
  /// [1] Relative distance of lines whose model errors are independent: a half-power bandwidth.
  double independent = 0.05;
  double first_error = 0.1;   ///< [1] relative error of the FRFs in the first pass
  double least_error = 0.01;  ///< [1] and the least one in the second
  int passes = 2;
  int starts = 5;      ///< stiffnesses on each axis of the grid of start values
  double bound = 5.0;  ///< [standard deviations] of the prior
};
constexpr FitSettings FIT;

constexpr double ANOTHER_MODE = 0.5;  // [1] of the largest peak: higher peaks are modes in competition

/// Free-free receptances of a tool at the lines of a fit, for the last factors on its flutes.
class ToolLines {
 public:
  ToolLines(const ToolDescription& tool, std::vector<double> frequency)
      : tool_(tool), frequency_(std::move(frequency)) {}

  const std::vector<EndReceptances>& at(double flute_factor) const {
    const auto found = cached_.find(flute_factor);
    if (found != cached_.end()) return found->second;
    if (cached_.size() > 8) cached_.clear();
    const std::vector<BeamSegment> segments = tool_.segments(flute_factor);
    std::vector<EndReceptances>& lines = cached_[flute_factor];
    for (const double f : frequency_) lines.push_back(beamReceptances(segments, f));
    return lines;
  }
  const std::vector<double>& frequency() const { return frequency_; }

 private:
  ToolDescription tool_;
  std::vector<double> frequency_;
  mutable std::map<double, std::vector<EndReceptances>> cached_;
};

/// A tapped tool at the lines of the fit.
struct FitLines {
  ToolLines tool;
  std::vector<Complex> measured;
  std::vector<Receptance> back;
};

Receptance complianceOf(const Eigen::VectorXd& log_value, double f) {
  const double w = TWO_PI * f;
  Receptance c = Receptance::Zero();
  c(0, 0) = 1.0 / Complex(std::exp(log_value[translation]), w * std::exp(log_value[translation_damping]));
  c(1, 1) = 1.0 / Complex(std::exp(log_value[rotation]), w * std::exp(log_value[rotation_damping]));
  return c;
}

/// Relative differences, bounded: (H - measured) over the mean of both magnitudes.
/// @param at contact, then the factor on the flutes of each tool
void differences(const std::vector<FitLines>& lines, const Eigen::VectorXd& at, Eigen::VectorXd& residual) {
  Eigen::Index row = 0, own = flutes;
  for (const FitLines& tapped : lines) {
    const std::vector<EndReceptances>& tool = tapped.tool.at(std::exp(at[own++]));
    for (std::size_t i = 0; i < tool.size(); ++i) {
      const Complex h = joined(tool[i], tapped.back[i], complianceOf(at, tapped.tool.frequency()[i]))(0, 0);
      const Complex off = (h - tapped.measured[i]) / (0.5 * (std::abs(h) + std::abs(tapped.measured[i])));
      residual[row++] = off.real();
      residual[row++] = off.imag();
    }
  }
}

TipPeak peakAt(const FrequencyResponse& tip, std::size_t at) {
  TipPeak peak{tip.frequency[at], std::abs(tip.value[at]), 0.0};
  if (at > 0 && at + 1 < tip.size()) {
    // Parabola through the peak of 1 / |H|^2, which is one for a single mode.
    const double left = 1.0 / std::norm(tip.value[at - 1]), middle = 1.0 / std::norm(tip.value[at]),
                 right = 1.0 / std::norm(tip.value[at + 1]);
    const double bend = left - 2.0 * middle + right,
                 step = 0.5 * (tip.frequency[at + 1] - tip.frequency[at - 1]);
    if (bend > 0.0) {
      const double shift = std::clamp(0.5 * (left - right) / bend, -0.5, 0.5);
      peak.frequency += shift * step;
      const double top = middle - 0.125 * std::pow(left - right, 2) / bend;
      if (top > 0.5 * middle) peak.flexibility = 1.0 / std::sqrt(top);
      // 1 / |H|^2 doubles at half the bandwidth.
      peak.damping = step * std::sqrt(2.0 / (bend * std::pow(peak.flexibility, 2))) / peak.frequency;
    }
  }
  return peak;
}

}  // namespace

void ToolDescription::validate() const {
  const auto check = [this](bool good, const char* what, double value, const char* expected) {
    if (!good || !std::isfinite(value))
      throw Error("tool " + name + ": " + what + ": " + shortNumber(value) + ": expected " + expected);
  };
  check(stickout > 0.0, "stickout [m]", stickout, "above 0");
  check(diameter > 0.0, "diameter [m]", diameter, "above 0");
  check(fluted_length >= 0.0 && fluted_length <= stickout, "fluted length [m]", fluted_length,
        "0 .. stickout");
  check(flute_ratio > 0.3 && flute_ratio <= 1.0, "flute ratio", flute_ratio, "0.3 .. 1");
  check(material.young > 0.0 && material.density > 0.0, "Young's modulus [N/m2]", material.young,
        "modulus and density above 0");
}

std::vector<BeamSegment> ToolDescription::segments(double flute_factor) const {
  std::vector<BeamSegment> segments;
  if (fluted_length > 0.0)
    segments.push_back({fluted_length, diameter * flute_ratio * flute_factor, 0.0, material, {}});
  if (stickout > fluted_length) segments.push_back({stickout - fluted_length, diameter, 0.0, material, {}});
  return segments;
}

ContactEstimate ContactEstimate::prior() {
  ContactEstimate prior;
  prior.log_value << std::log(5e7), std::log(2e5), std::log(300.0), std::log(1.0), 0.0;
  const double wide = 2.0, flute = 0.03;
  prior.covariance = ContactMatrix::Identity() * wide * wide;
  prior.covariance(flutes, flutes) = flute * flute;
  return prior;
}

ContactEstimate ContactEstimate::forAnotherTool(double scatter) const {
  ContactEstimate other = prior();
  other.log_value.head<flutes>() = log_value.head<flutes>();
  other.covariance.topLeftCorner<flutes, flutes>() = covariance.topLeftCorner<flutes, flutes>();
  for (int i = 0; i < flutes; ++i) other.covariance(i, i) += scatter * scatter;
  return other;
}

double ContactEstimate::value(ContactUnknown which) const {
  return std::exp(log_value[which]);
}

Receptance ContactEstimate::compliance(double f) const {
  return complianceOf(log_value, f);
}

TipPeak tipPeak(const FrequencyResponse& tip) {
  if (tip.size() < 3) throw Error("tip FRF: expected at least three lines");
  std::size_t at = 0;
  for (std::size_t i = 0; i < tip.size(); ++i)
    if (std::abs(tip.value[i]) > std::abs(tip.value[at])) at = i;
  return peakAt(tip, at);
}

TipPeak tipPeak(const FrequencyResponse& tip, double near, double least_share) {
  const TipPeak largest = tipPeak(tip);
  TipPeak best = largest;
  for (std::size_t i = 1; i + 1 < tip.size(); ++i) {
    const double here = std::abs(tip.value[i]);
    if (here < least_share * largest.flexibility || here < std::abs(tip.value[i - 1]) ||
        here < std::abs(tip.value[i + 1]))
      continue;
    if (std::abs(std::log(tip.frequency[i] / near)) < std::abs(std::log(best.frequency / near)))
      best = peakAt(tip, i);
  }
  return best;
}
ToolAssembly::ToolAssembly(const SpindleReceptances& spindle, const std::vector<BeamSegment>& holder,
                           const AssemblyOptions& options)
    : frequency_(spindle.frequency), options_(options) {
  for (const BeamSegment& segment : holder) segment.validate();
  if (frequency_.size() != spindle.value.size() || frequency_.empty())
    throw Error("spindle receptances: expected one per line");
  for (std::size_t i = 0; i < frequency_.size(); ++i)
    back_.push_back(holder.empty() ? spindle.value[i]
                                   : joined(beamReceptances(holder, frequency_[i]), spindle.value[i],
                                            Receptance::Zero()));
}

FrequencyResponse ToolAssembly::tip(const ToolDescription& tool, const ContactEstimate& contact) const {
  tool.validate();
  const std::vector<BeamSegment> segments = tool.segments(contact.value(flutes));
  FrequencyResponse frf;
  frf.unit = "m/N";
  frf.frequency = frequency_;
  for (std::size_t i = 0; i < frequency_.size(); ++i)
    frf.value.push_back(
        joined(beamReceptances(segments, frequency_[i]), back_[i], contact.compliance(frequency_[i]))(0, 0));
  return frf;
}

ContactEstimate ToolAssembly::fit(const std::vector<TappedTool>& tapped, const ContactEstimate& prior) const {
  if (tapped.empty()) throw Error("contact: expected at least one tapped tool");
  std::vector<FitLines> lines;
  Eigen::Index rows = 0;
  for (const TappedTool& t : tapped) {
    t.tool.validate();
    if (t.tip.unit != "m/N") throw Error("tool " + t.tool.name + ": FRF in " + t.tip.unit + ": expected m/N");
    std::vector<std::size_t> within;
    for (std::size_t i = 0; i < frequency_.size(); ++i)
      if (frequency_[i] >= t.tip.frequency.front() && frequency_[i] <= t.tip.frequency.back())
        within.push_back(i);
    const std::size_t step = within.size() / FIT.most_lines + 1;
    std::vector<double> frequency;
    std::vector<Complex> measured;
    std::vector<Receptance> back;
    for (std::size_t k = 0; k < within.size(); k += step) {
      const std::size_t i = within[k];
      frequency.push_back(frequency_[i]);
      measured.push_back(t.tip.at(frequency_[i]));
      back.push_back(back_[i]);
    }
    if (frequency.size() < 10)
      throw Error("tool " + t.tool.name + ": FRF: expected at least ten lines in the band of the spindle");
    rows += 2 * static_cast<Eigen::Index>(frequency.size());
    lines.push_back({ToolLines(t.tool, frequency), measured, back});
  }
  // Lines closer than a bandwidth share their model error.
  double independent = 0.0;
  for (const FitLines& l : lines)
    independent += 2.0 * std::log(l.tool.frequency().back() / l.tool.frequency().front()) / FIT.independent;
  const double repeated = std::max(1.0, static_cast<double>(rows) / independent);

  // Unknowns: the contact, then the flutes of each tool about the same prior.
  const auto own = static_cast<Eigen::Index>(lines.size());
  const Eigen::Index unknowns = flutes + own;
  Eigen::VectorXd mean(unknowns);
  mean << prior.log_value.head<flutes>(), Eigen::VectorXd::Constant(own, prior.log_value[flutes]);
  Eigen::MatrixXd covariance =
      Eigen::MatrixXd::Identity(unknowns, unknowns) * prior.covariance(flutes, flutes);
  covariance.topLeftCorner<flutes, flutes>() = prior.covariance.topLeftCorner<flutes, flutes>();
  const Eigen::MatrixXd identity = Eigen::MatrixXd::Identity(unknowns, unknowns);
  const Eigen::MatrixXd whitening = covariance.llt().matrixL().solve(identity);
  double error = FIT.first_error;
  const auto residuals = [&](const Eigen::VectorXd& at, Eigen::VectorXd& residual) {
    Eigen::VectorXd off(rows);
    differences(lines, at, off);
    residual.head(rows) = off / (error * std::sqrt(repeated));
    residual.tail(unknowns) = whitening * (at - mean);
  };
  const fit::FunctionResiduals problem(rows + unknowns, residuals);

  // The cost has several minima in the stiffnesses: start at the best of a grid.
  Eigen::VectorXd start = mean, residual(rows + unknowns);
  double least = std::numeric_limits<double>::infinity();
  const int half = FIT.starts / 2;
  for (int i = -half; i <= half; ++i) {
    for (int j = -half; j <= half; ++j) {
      Eigen::VectorXd at = mean;
      at[translation] += i * std::sqrt(covariance(translation, translation));
      at[rotation] += j * std::sqrt(covariance(rotation, rotation));
      residuals(at, residual);
      const double cost = residual.squaredNorm();
      if (!(cost < least)) continue;
      least = cost;
      start = at;
    }
  }
  fit::Result result;
  for (int pass = 0; pass < FIT.passes; ++pass) {
    std::vector<fit::Parameter> parameters;
    for (Eigen::Index i = 0; i < unknowns; ++i) {
      const double deviation = std::sqrt(covariance(i, i));
      parameters.push_back({start[i], mean[i] - FIT.bound * deviation, mean[i] + FIT.bound * deviation,
                            std::min(0.3, deviation)});
    }
    fit::Options options;
    options.name = "contact";
    options.iterations = 40;
    options.function_tolerance = 1e-6;
    result = fit::minimise(problem, parameters, options);
    if (!result.usable()) throw Error("contact: " + result.message);
    start = result.value;
    Eigen::VectorXd off(rows);
    differences(lines, start, off);
    error = std::max(FIT.least_error, off.norm() / std::sqrt(static_cast<double>(rows)));
  }
  // The flutes are those of the first tool. A value at a bound counts as known.
  ContactEstimate estimate;
  estimate.log_value = result.value.head<contact_unknowns>();
  estimate.covariance = result.covariance().matrix.topLeftCorner<contact_unknowns, contact_unknowns>() +
                        1e-8 * ContactMatrix::Identity();
  return estimate;
}

TipPrediction ToolAssembly::predict(const ToolDescription& tool, const ContactEstimate& contact) const {
  TipPrediction prediction;
  prediction.tip = tip(tool, contact);
  prediction.peak = tipPeak(prediction.tip);
  const ContactMatrix root = contact.covariance.llt().matrixL();
  std::mt19937_64 random(options_.seed);
  std::normal_distribution<double> normal;
  std::vector<double> frequency, flexibility, damping, squares(frequency_.size(), 0.0);
  for (int draw = 0; draw < options_.draws; ++draw) {
    ContactEstimate drawn = contact;
    ContactVector step;
    for (int i = 0; i < contact_unknowns; ++i) step[i] = normal(random);
    drawn.log_value += root * step;
    ToolDescription other = tool;
    other.material.young *= std::exp(options_.tool_error * normal(random));
    ToolAssembly machine = *this;
    const double compliance = std::exp(options_.spindle_error * normal(random));
    for (Receptance& b : machine.back_) b *= compliance;
    const FrequencyResponse frf = machine.tip(other, drawn);
    // The same mode, where two are nearly equal.
    const TipPeak peak = tipPeak(frf, prediction.peak.frequency, ANOTHER_MODE);
    frequency.push_back(peak.frequency);
    flexibility.push_back(peak.flexibility);
    damping.push_back(peak.damping);
    for (std::size_t i = 0; i < squares.size(); ++i)
      squares[i] += std::norm(frf.value[i] - prediction.tip.value[i]) / options_.draws;
  }
  for (const double square : squares) prediction.tip.std_dev.push_back(std::sqrt(square));
  prediction.frequency_std = standardDeviation(frequency);
  prediction.flexibility_std = standardDeviation(flexibility);
  prediction.damping_std = standardDeviation(damping);
  return prediction;
}

ModalModel modesOf(const TipPrediction& prediction) {
  FrequencyResponse smooth = prediction.tip;
  smooth.std_dev.clear();  // the prediction has no noise; its deviations are correlated
  ModalFitOptions options;
  options.low = smooth.frequency.front();
  options.high = smooth.frequency.back();
  options.positive_gains = true;
  ModalModel model = fitModes(smooth, options).model;
  const double frequency = prediction.frequency_std / prediction.peak.frequency,
               gain = prediction.flexibility_std / prediction.peak.flexibility,
               damping =
                   prediction.peak.damping > 0.0 ? prediction.damping_std / prediction.peak.damping : gain;
  for (Mode& mode : model.modes) {
    mode.frequency_std = frequency * mode.frequency;
    mode.damping_ratio_std = std::min(0.9, damping) * mode.damping_ratio;
    mode.gain_std = std::min(0.9, gain) * mode.gain;
  }
  return model;
}

}  // namespace smartmill::stability
