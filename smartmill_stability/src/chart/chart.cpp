#include "smartmill_stability/chart/chart.h"

#include <algorithm>
#include <cmath>
#include <complex>
#include <functional>
#include <map>
#include <memory>
#include <random>

#include "smartmill_core/cutting/lobe_flanks.h"
#include "smartmill_core/cutting/mechanistic.h"
#include "smartmill_core/error.h"
#include "smartmill_core/units.h"
#include "smartmill_stability/chart/risk.h"
#include "smartmill_stability/chart/uncertainty.h"
#include "smartmill_stability/solvers/cross_modes.h"
#include "smartmill_stability/solvers/solver.h"

namespace smartmill::stability {
namespace {

constexpr double NO_LIMIT = std::numeric_limits<double>::infinity();
/// [1] Points with a smaller relative difference of speed belong to one pocket or valley.
constexpr double SAME_POCKET = 0.03;
constexpr int EXTRA_SPEEDS = 20;  // on each side of the chart, for the speed margin

/// Worst value over the speeds within the margin on both sides, including the next speed of the grid.
double around(const StabilityLimit& limit, std::size_t k, double margin,
              const std::function<bool(double, double)>& worse) {
  double worst = limit.depth[k];
  const double speed = limit.spindle_speed[k];
  for (std::size_t j = k; j > 0 && limit.spindle_speed[j] >= speed * (1.0 - margin); --j) {
    if (worse(limit.depth[j - 1], worst)) worst = limit.depth[j - 1];
  }
  for (std::size_t j = k; j + 1 < limit.depth.size() && limit.spindle_speed[j] <= speed * (1.0 + margin);
       ++j) {
    if (worse(limit.depth[j + 1], worst)) worst = limit.depth[j + 1];
  }
  return worst;
}

bool removesMore(const StabilityPoint& a, const StabilityPoint& b) {
  return a.material_removal_rate > b.material_removal_rate;
}

/// The first points in the given order, one for each pocket.
std::vector<StabilityPoint> pick(
    std::vector<StabilityPoint> points, int count,
    const std::function<bool(const StabilityPoint&, const StabilityPoint&)>& better) {
  std::stable_sort(points.begin(), points.end(), better);
  std::vector<StabilityPoint> chosen;
  for (const StabilityPoint& point : points) {
    if (static_cast<int>(chosen.size()) >= count) break;
    const bool near = std::any_of(chosen.begin(), chosen.end(), [&](const StabilityPoint& other) {
      return std::abs(point.spindle_speed / other.spindle_speed - 1.0) < SAME_POCKET;
    });
    if (!near) chosen.push_back(point);
  }
  return chosen;
}

/// Of the neighbouring cuts with nearly the same removal rate as the best, the one with the largest margin of
/// speed to the nearer flank of its lobe. Where the power limits the removal rate it is constant over the
/// pocket.
StabilityPoint farthestFromFlanks(const StabilityLimit& limit, const std::vector<StabilityPoint>& cuts,
                                  const StabilityPoint& best) {
  constexpr double AS_MUCH = 0.98;
  const auto margin = [&](const StabilityPoint& cut) {
    const auto [below, above] = lobeFlanks(limit, cut.spindle_speed, cut.axial_depth);
    return std::min(below, above) / cut.spindle_speed;
  };
  const auto at = std::find_if(cuts.begin(), cuts.end(), [&](const StabilityPoint& cut) {
    return cut.spindle_speed == best.spindle_speed;
  });
  const auto enough = [&](const StabilityPoint& cut) {
    return cut.material_removal_rate >= AS_MUCH * best.material_removal_rate;
  };
  auto from = at, to = at;
  while (from != cuts.begin() && enough(*(from - 1))) --from;
  while (to != cuts.end() && enough(*to)) ++to;
  return *std::max_element(
      from, to, [&](const StabilityPoint& a, const StabilityPoint& b) { return margin(a) < margin(b); });
}

}  // namespace

namespace {

/// Removes lines with too little excitation and lines below a multiple of their own standard deviation, where
/// noise would appear as a resonance. Interpolation between the neighbours replaces them.
/// @param error [1] largest standard deviation over the peak @param factor [1] least value over standard
/// deviation
FrequencyResponse certainLines(const FrequencyResponse& frf, double error, double factor) {
  if (frf.std_dev.size() != frf.size()) return frf;
  double peak = 0.0;
  for (std::size_t i = 0; i < frf.size(); ++i) {
    if (frf.std_dev[i] < std::abs(frf.value[i])) peak = std::max(peak, std::abs(frf.value[i]));
  }
  FrequencyResponse result;
  result.unit = frf.unit;
  result.averages = frf.averages;
  for (std::size_t i = 0; i < frf.size(); ++i) {
    if (frf.std_dev[i] > error * peak || std::abs(frf.value[i]) < factor * frf.std_dev[i]) continue;
    result.frequency.push_back(frf.frequency[i]);
    result.value.push_back(frf.value[i]);
  }
  return result;
}

/// Adds cross receptances that were measured over the whole band. "xy": excitation along x, response along y.
/// A single one is used for both (reciprocity).
void addCross(const std::map<std::string, MeasuredFrf>& frfs, ToolTipResponse& response) {
  const auto lines = [&](const char* direction) {
    std::vector<std::complex<double>> values;
    const auto found = frfs.find(direction);
    if (found == frfs.end() || found->second.frf.size() < 2 || found->second.frf.unit != "m/N") return values;
    const FrequencyResponse& frf = found->second.frf;
    if (frf.frequency.front() > response.frequency.front() ||
        frf.frequency.back() < response.frequency.back())
      return values;
    // Lines within the noise are set to 0; they would lower the limit at random.
    FrequencyResponse significant = frf;
    for (std::size_t i = 0; i < significant.size() && significant.std_dev.size() == significant.size(); ++i) {
      if (std::abs(significant.value[i]) < 2.0 * significant.std_dev[i]) significant.value[i] = 0.0;
    }
    for (const double f : response.frequency) values.push_back(significant.at(f));
    return values;
  };
  response.yx = lines("xy");
  response.xy = lines("yx");
  if (response.xy.empty()) response.xy = response.yx;
  if (response.yx.empty()) response.yx = response.xy;
}

/// Limits at ascending speeds: solved by bisection until linear interpolation between the neighbours is right
/// to STRAIGHT, then interpolated.
StabilityLimit refinedLimits(const StabilitySolver& solver, const std::vector<double>& speeds,
                             double max_depth) {
  constexpr std::size_t STRIDE = 16;
  constexpr double STRAIGHT = 3e-3;
  StabilityLimit limit;
  limit.spindle_speed = speeds;
  limit.depth.assign(speeds.size(), NO_LIMIT);
  limit.chatter_frequency.assign(speeds.size(), std::numeric_limits<double>::quiet_NaN());
  const auto solve = [&](std::size_t i) {
    const Limit found = solver.limit(speeds[i], max_depth);
    limit.depth[i] = found.depth;
    limit.chatter_frequency[i] = found.frequency;
  };
  const auto between = [&](std::size_t a, std::size_t b, std::size_t i, const std::vector<double>& values) {
    const double share = (speeds[i] - speeds[a]) / (speeds[b] - speeds[a]);
    return values[a] + share * (values[b] - values[a]);
  };
  const std::function<void(std::size_t, std::size_t)> fill = [&](std::size_t a, std::size_t b) {
    if (b - a < 2) return;
    const std::size_t middle = (a + b) / 2;
    solve(middle);
    const double expected = between(a, b, middle, limit.depth);
    const double frequency = between(a, b, middle, limit.chatter_frequency);
    const bool all_stable =
        std::isinf(limit.depth[a]) && std::isinf(limit.depth[b]) && std::isinf(limit.depth[middle]);
    const bool straight = std::abs(limit.depth[middle] - expected) <= STRAIGHT * expected &&
                          std::abs(limit.chatter_frequency[middle] - frequency) <= STRAIGHT * frequency;
    if (!all_stable && !(straight && std::isfinite(expected))) {
      fill(a, middle);
      fill(middle, b);
      return;
    }
    if (all_stable) return;
    for (const auto& [from, to] : {std::pair{a, middle}, {middle, b}}) {
      for (std::size_t i = from + 1; i < to; ++i) {
        limit.depth[i] = between(from, to, i, limit.depth);
        limit.chatter_frequency[i] = between(from, to, i, limit.chatter_frequency);
      }
    }
  };
  solve(0);
  for (std::size_t a = 0; a + 1 < speeds.size();) {
    const std::size_t b = std::min(a + STRIDE, speeds.size() - 1);
    solve(b);
    fill(a, b);
    a = b;
  }
  return limit;
}

}  // namespace

struct ChartMaker::Basis {
  RegenerativeProcess process;
  ToolTipResponse response;                 // zero-order
  std::unique_ptr<StabilitySolver> solver;  // collocation
  double max_depth = 0.0;                   // [m] of the search by collocation

  StabilityLimit limits(const std::vector<double>& speeds) const {
    return solver ? refinedLimits(*solver, speeds, max_depth) : zeroOrderLimit(process, response, speeds);
  }
};

ChartMaker::ChartMaker(const ChartParameters& parameters, const MachineModel& model)
    : parameters_(parameters), tool_geometry_(model.needTool("predict stability")) {
  if (model.spindle) spindle_ = *model.spindle;
  if (parameters_.speed_high == 0.0 && spindle_.max_speed) parameters_.speed_high = *spindle_.max_speed;
  parameters_.validate();
  if (parameters_.speed_high == 0.0) {
    throw Error("speed_high: 0 selects the highest spindle speed, which is missing in " + model.file +
                "; expected a value above speed_low");
  }
}

void ChartMaker::use(const std::string& tool, double stamp) {
  if (tool != tool_) {
    frfs_.clear();
    modes_.clear();
    tool_ = tool;
  }
  stamp_ = std::max(stamp_, stamp);
}

void ChartMaker::handle(const MeasuredFrf& frf) {
  if (frf.point != POINT_TOOL_TIP) return;
  use(frf.tool, frf.stamp);
  frfs_[frf.direction] = frf;
}

void ChartMaker::handle(const MeasuredModes& modes) {
  if (modes.point != POINT_TOOL_TIP) return;
  use(modes.tool, modes.stamp);
  modes_[modes.direction] = modes;
}

void ChartMaker::handle(const CoefficientSet& coefficients) {
  stamp_ = std::max(stamp_, coefficients.stamp);
  coefficients_ = coefficients;
}

std::string ChartMaker::missing() const {
  std::string list;
  const auto need = [&](bool present, const std::string& what) {
    if (!present) list += (list.empty() ? "" : ", ") + what;
  };
  for (const std::string direction : {"x", "y"}) {
    if (needsModes()) {
      need(modes_.count(direction) > 0, "modes in " + direction);
    } else if (!byCollocation()) {
      need(frfs_.count(direction) > 0, "FRF in " + direction);
    }
  }
  need(coefficients_ && coefficients_->value.ktc > 0.0, "tangential coefficient");
  return list;
}

bool ChartMaker::needsModes() const {
  return parameters_.method == "collocation" || (parameters_.method == "zero_order" && parameters_.use_modes);
}

bool ChartMaker::byCollocation() const {
  if (parameters_.method != "auto") return parameters_.method == "collocation";
  const auto good = [this](const char* direction) {
    const auto found = modes_.find(direction);
    return found != modes_.end() && !found->second.model.modes.empty() &&
           found->second.relative_error <= parameters_.modes_error;
  };
  return good("x") && good("y");
}

std::optional<RegenerativeSystem> ChartMaker::system(const Engagement& engagement) const {
  if (!modes_.count("x") || !modes_.count("y") || !coefficients_ || !(coefficients_->value.ktc > 0.0))
    return {};
  const CuttingCoefficients& cutting = coefficients_->value;
  const bool given = engagement.exit > engagement.entry;
  RegenerativeSystem system;
  system.modes = crossModes(modes_.at("x").model, modes_.at("y").model, crossFrf());
  system.teeth = tool_geometry_.teeth;
  system.pitch = tool_geometry_.pitch;
  system.helix = tool_geometry_.helix;
  system.diameter = tool_geometry_.diameter;
  system.entry = given ? engagement.entry : parameters_.entry;
  system.exit = given ? engagement.exit : parameters_.exit;
  system.kt = cutting.ktc;
  system.kr = std::isfinite(cutting.krc) ? cutting.krc : parameters_.radial_ratio * cutting.ktc;
  return system;
}

std::optional<UncertainSystem> ChartMaker::uncertainSystem(const Engagement& engagement) const {
  const std::optional<RegenerativeSystem> mean = system(engagement);
  if (!mean) return {};
  LeastDeviations least;
  least.frequency = parameters_.frequency_std;
  least.damping = least.gain = least.cutting = parameters_.gain_std;
  least.radial = parameters_.radial_std;
  return measuredSystem(*mean, modes_.at("x").model, modes_.at("y").model, *coefficients_, least);
}

/// The measured cross receptance, in either direction; empty without one.
FrequencyResponse ChartMaker::crossFrf() const {
  for (const char* direction : {"xy", "yx"}) {
    const auto found = frfs_.find(direction);
    if (found != frfs_.end() && found->second.frf.unit == "m/N")
      return certainLines(found->second.frf.band(parameters_.frequency_low, parameters_.frequency_high),
                          parameters_.line_error, 0.0);
  }
  return {};
}

std::size_t ChartMaker::modesInX() const {
  return modes_.count("x") ? systemModes(modes_.at("x").model, 0).size() : 0;
}

ChartMaker::Basis ChartMaker::basis() const {
  const std::string lacking = missing();
  if (!lacking.empty()) throw Error("no chart yet, missing: " + lacking);
  Basis basis;
  const CuttingCoefficients& cutting = coefficients_->value;
  basis.process.teeth = tool_geometry_.teeth;
  basis.process.entry = parameters_.entry;
  basis.process.exit = parameters_.exit;
  basis.process.kt = cutting.ktc;
  basis.process.radial_ratio =
      std::isfinite(cutting.krc) ? cutting.krc / cutting.ktc : parameters_.radial_ratio;
  if (byCollocation()) {
    const RegenerativeSystem system = *this->system({});
    SolverOptions options;
    options.tolerance = 1e-4;
    options.nodes = 10;  // 1e-6 of the depth, enough for a chart
    basis.solver = makeSolver(Method::collocation, system, options);
    // A limit beyond this depth does not restrict a recommended cut.
    basis.max_depth = parameters_.max_depth / (1.0 - parameters_.depth_margin);
  } else if (parameters_.use_modes) {
    constexpr std::size_t LINES = 20000;
    basis.response = responseOf(modes_.at("x").model, modes_.at("y").model,
                                std::max(1.0, parameters_.frequency_low), parameters_.frequency_high, LINES);
  } else {
    constexpr double STD_DEVS = 3.0;
    const auto lines = [&](const char* direction) {
      return certainLines(frfs_.at(direction).frf.band(parameters_.frequency_low, parameters_.frequency_high),
                          parameters_.line_error, STD_DEVS);
    };
    basis.response = responseOf(lines("x"), lines("y"));
    addCross(frfs_, basis.response);
  }
  return basis;
}

double ChartMaker::torquePerDepth() const {
  Engagement engagement{parameters_.entry, parameters_.exit, 1e-3, parameters_.feed_per_tooth};
  const auto row = meanForceMatrix(tool_geometry_, engagement)[3];
  const double edge = std::isfinite(coefficients_->value.kte) ? coefficients_->value.kte : 0.0;
  return (row[0] * coefficients_->value.ktc + row[3] * edge) / engagement.axial_depth;
}

double ChartMaker::friction(double speed) const {
  const bool found =
      std::isfinite(coefficients_->friction_viscous) && std::isfinite(coefficients_->friction_coulomb);
  const double torque = found ? coefficients_->friction_viscous * speed + coefficients_->friction_coulomb
                              : spindle_.viscous * speed + spindle_.coulomb;
  return std::max(0.0, torque);
}

std::array<double, 2> ChartMaker::loadLimits(double speed) const {
  const double per_depth = torquePerDepth(), loss = friction(speed);
  const double torque =
      spindle_.rated_torque ? std::max(0.0, *spindle_.rated_torque - loss) / per_depth : NO_LIMIT;
  const double power =
      spindle_.rated_power ? std::max(0.0, *spindle_.rated_power / speed - loss) / per_depth : NO_LIMIT;
  return {{torque, power}};
}

StabilityPoint ChartMaker::point(double speed, double depth, double limit, double frequency) const {
  StabilityPoint result{speed, depth, limit, frequency};
  result.torque = torquePerDepth() * depth;
  result.power = result.torque * speed;
  // A tooth removes the integral of c sin(phi) R over its engagement.
  const double area = parameters_.feed_per_tooth * tool_geometry_.radius() *
                      (std::cos(parameters_.entry) - std::cos(parameters_.exit));
  result.material_removal_rate = area * depth * tool_geometry_.teeth * speed / units::TWO_PI;
  return result;
}

int ChartMaker::extraSpeeds() const {
  return parameters_.speed_margin > 0.0 ? EXTRA_SPEEDS : 0;
}

StabilityLimit ChartMaker::wideLimits(const Basis& given) const {
  const int n = parameters_.speeds, extra = extraSpeeds();
  const double low = parameters_.speed_low, high = parameters_.speed_high,
               step = parameters_.speed_margin / EXTRA_SPEEDS;
  std::vector<double> speeds;
  for (int i = -extra; i < n + extra; ++i) {
    speeds.push_back(i < 0    ? low * (1.0 + step * i)
                     : i >= n ? high * (1.0 + step * (i - n + 1))
                              : low + (high - low) * i / (n - 1));
  }
  return given.limits(speeds);
}

/// [1] Depth at the accepted risk over the limit at each speed; +inf without modes, which drawing requires.
std::vector<double> ChartMaker::depthShares(const std::vector<double>& speeds) const {
  constexpr int DRAWS = 100;
  constexpr unsigned SEED = 1;
  std::vector<double> shares(speeds.size(), std::numeric_limits<double>::infinity());
  const std::optional<UncertainSystem> uncertain = uncertainSystem({});
  if (parameters_.risk > 0.0 && uncertain) {
    shares = depthsAtRisk(drawnLimits(*uncertain, speeds, DRAWS, SEED), speeds, parameters_.risk,
                          parameters_.speed_margin);
  }
  return shares;
}

void ChartMaker::recommend(StabilityChart& chart, const StabilityLimit& wide) const {
  const std::vector<double>& speeds = chart.limit.spindle_speed;
  const std::vector<double> shares = depthShares(speeds);
  std::vector<StabilityPoint> cuts, peaks;
  for (std::size_t k = 0; k < speeds.size(); ++k) {
    const double stable =
        around(wide, k + static_cast<std::size_t>(extraSpeeds()), parameters_.speed_margin, std::less<>());
    const double depth = std::min({(1.0 - parameters_.depth_margin) * stable,
                                   shares[k] * chart.limit.depth[k], permittedDepth(chart, k)});
    cuts.push_back(point(speeds[k], depth, chart.limit.depth[k], chart.limit.chatter_frequency[k]));
  }
  for (std::size_t k = 0; k < cuts.size(); ++k) {
    const double rate = cuts[k].material_removal_rate;
    const bool above_left = k == 0 || rate > cuts[k - 1].material_removal_rate;
    const bool above_right = k + 1 == cuts.size() || rate >= cuts[k + 1].material_removal_rate;
    if (rate > 0.0 && above_left && above_right) peaks.push_back(cuts[k]);
  }
  peaks = pick(peaks, static_cast<int>(peaks.size()), removesMore);
  for (StabilityPoint& best : peaks) best = farthestFromFlanks(chart.limit, cuts, best);
  peaks = pick(peaks, static_cast<int>(peaks.size()), removesMore);  // some may now coincide
  chart.recommended = confirmed(std::move(peaks));
}

/// The best of the peaks whose stability collocation confirms, since the zero-order solution misses flips. A
/// rejected point is tried again at a smaller depth, in the order of the reduced removal rate.
std::vector<StabilityPoint> ChartMaker::confirmed(std::vector<StabilityPoint> peaks) const {
  constexpr double REDUCTION = 0.95,
                   LEAST = 0.2;  // [1] of the depth: per try, and in all before it is dropped
  const std::optional<UncertainSystem> uncertain = uncertainSystem({});
  RiskOptions options;
  options.risk = parameters_.risk;
  options.speed_margin = parameters_.speed_margin;
  std::optional<DrawnMachines> machines;
  if (parameters_.risk > 0.0 && uncertain) machines.emplace(*uncertain, options);
  const bool mean_known = byCollocation();  // the limits of the chart are from collocation already
  const auto isStable = [&](const StabilityPoint& cut) {
    if (!machines) return true;
    const double depth = cut.axial_depth / (1.0 - parameters_.depth_margin);
    return (mean_known || machines->meanIsStable(cut.spindle_speed, depth)) &&
           machines->probability(cut.spindle_speed, cut.axial_depth).has_value();
  };
  std::stable_sort(peaks.begin(), peaks.end(), removesMore);
  std::map<double, double> least;  // [m] by speed
  for (const StabilityPoint& cut : peaks) least[cut.spindle_speed] = LEAST * cut.axial_depth;
  std::vector<StabilityPoint> found;
  while (!peaks.empty() && static_cast<int>(found.size()) < parameters_.recommended) {
    const StabilityPoint cut = peaks.front();
    peaks.erase(peaks.begin());
    if (isStable(cut)) {
      found.push_back(cut);
      continue;
    }
    const StabilityPoint reduced =
        point(cut.spindle_speed, REDUCTION * cut.axial_depth, cut.depth_limit, cut.chatter_frequency);
    if (reduced.axial_depth > least[reduced.spindle_speed])
      peaks.insert(std::upper_bound(peaks.begin(), peaks.end(), reduced, removesMore), reduced);
  }
  return found;
}

void ChartMaker::proposeUnstable(StabilityChart& chart, const StabilityLimit& wide) const {
  const std::vector<double>& speeds = chart.limit.spindle_speed;
  const std::vector<double>& depth = chart.limit.depth;
  std::vector<StabilityPoint> valleys;
  for (std::size_t k = 1; k + 1 < speeds.size(); ++k) {
    if (!(depth[k] < depth[k - 1] && depth[k] <= depth[k + 1])) continue;
    const double highest =
        around(wide, k + static_cast<std::size_t>(extraSpeeds()), parameters_.speed_margin, std::greater<>());
    const double proposed = std::min(parameters_.unstable_factor * highest, permittedDepth(chart, k));
    if (!std::isfinite(proposed) || proposed < ChartParameters::CLEARLY_UNSTABLE * highest) continue;
    valleys.push_back(point(speeds[k], proposed, depth[k], chart.limit.chatter_frequency[k]));
  }
  // A check close to the recommended cut is the most informative: nearly the same speed, another outcome.
  const double reference =
      chart.recommended.empty() ? speeds.back() : chart.recommended.front().spindle_speed;
  chart.unstable = pick(valleys, parameters_.unstable, [&](const StabilityPoint& a, const StabilityPoint& b) {
    return std::abs(std::log(a.spindle_speed / reference)) < std::abs(std::log(b.spindle_speed / reference));
  });
}

double ChartMaker::permittedDepth(const StabilityChart& chart, std::size_t k) const {
  return std::min({parameters_.load_share * chart.torque_depth_limit[k],
                   parameters_.load_share * chart.power_depth_limit[k], parameters_.max_depth});
}

StabilityChart ChartMaker::chart() const {
  const Basis given = basis();
  StabilityChart chart;
  chart.stamp = stamp_;
  chart.tool = tool_;
  chart.material = coefficients_->material;
  chart.entry = parameters_.entry;
  chart.exit = parameters_.exit;
  chart.feed_per_tooth = parameters_.feed_per_tooth;
  const StabilityLimit wide = wideLimits(given);
  const auto inner = [extra = extraSpeeds()](const std::vector<double>& all) {
    return std::vector<double>(all.begin() + extra, all.end() - extra);
  };
  chart.limit = {inner(wide.spindle_speed), inner(wide.depth), inner(wide.chatter_frequency)};
  chart.method = given.solver ? nameOf(Method::collocation) : nameOf(Method::zero_order);
  chart.absolute_depth_limit = given.solver
                                   ? *std::min_element(chart.limit.depth.begin(), chart.limit.depth.end())
                                   : absoluteDepthLimit(given.process, given.response);
  for (const double speed : chart.limit.spindle_speed) {
    const auto [torque, power] = loadLimits(speed);
    chart.torque_depth_limit.push_back(torque);
    chart.power_depth_limit.push_back(power);
  }
  recommend(chart, wide);
  proposeUnstable(chart, wide);
  return chart;
}

Prediction ChartMaker::predict(double spindle_speed, double axial_depth) const {
  if (!(spindle_speed > 0.0) || !std::isfinite(spindle_speed)) {
    throw Error("spindle_speed: " + std::to_string(spindle_speed) + " rad/s: expected a value above 0");
  }
  if (!(axial_depth > 0.0) || !std::isfinite(axial_depth)) {
    throw Error("axial_depth: " + std::to_string(axial_depth) + " m: expected a value above 0");
  }
  const Basis given = basis();
  const StabilityLimit limit = given.limits({spindle_speed});
  const auto [torque, power] = loadLimits(spindle_speed);
  Prediction prediction;
  prediction.point = point(spindle_speed, axial_depth, limit.depth[0], limit.chatter_frequency[0]);
  prediction.stable = axial_depth < limit.depth[0];
  prediction.within_spindle_limits =
      axial_depth <= std::min(torque, power) && (!spindle_.max_speed || spindle_speed <= *spindle_.max_speed);
  return prediction;
}

WhatIfChart ChartMaker::whatIf(const WhatIf& request) const {
  constexpr int SPEEDS = 300;
  constexpr double LEAST_DEPTH = 0.01;
  request.validate();
  ChartMaker other = *this;
  const auto change = [](double& value, double requested) {
    if (!std::isnan(requested)) value = requested;
  };
  change(other.tool_geometry_.helix, request.helix);
  change(other.parameters_.entry, request.entry);
  change(other.parameters_.exit, request.exit);
  change(other.parameters_.feed_per_tooth, request.feed_per_tooth);
  if (request.teeth > 0 && request.teeth != tool_geometry_.teeth) {
    other.tool_geometry_.teeth = request.teeth;
    other.tool_geometry_.pitch.clear();
  }
  other.parameters_.validate();
  std::optional<RegenerativeSystem> system = other.system({});
  if (!system) throw Error("no chart yet, missing: modes in x and y or the tangential coefficient");
  if (!std::isnan(request.overhang)) system->modes = withOverhang(system->modes, request.overhang);
  const int count = request.speeds > 0 ? request.speeds : SPEEDS;
  std::vector<double> speeds;
  for (int i = 0; i < count; ++i)
    speeds.push_back(parameters_.speed_low +
                     (parameters_.speed_high - parameters_.speed_low) * i / (count - 1));
  WhatIfChart chart;
  // Limits far beyond the requested depth would take most of the time.
  const double all = parameters_.max_depth / (1.0 - parameters_.depth_margin);
  const double deepest =
      std::isnan(request.axial_depth) ? all : std::min(all, std::max(LEAST_DEPTH, 3.0 * request.axial_depth));
  chart.limit = limitsByContinuation(*system, speeds, deepest);
  for (std::size_t k = 0; k < system->modes.size(); ++k) {
    const SystemMode& mode = system->modes[k];
    const bool along_x = std::abs(mode.output[0]) >= std::abs(mode.output[1]);
    chart.modes.push_back((along_x ? "x " : "y ") + std::to_string(std::lround(mode.frequency)) + " Hz");
  }
  int stable = 0;
  for (int i = 0; i < count; ++i) {
    const auto k = static_cast<std::size_t>(i);
    chart.mode.push_back(dominantMode(system->modes, chart.limit.chatter_frequency[k]));
    const auto [torque, power] = other.loadLimits(speeds[k]);
    chart.torque_depth_limit.push_back(torque);
    chart.power_depth_limit.push_back(power);
    stable += request.axial_depth < chart.limit.depth[k];
  }
  if (!std::isnan(request.axial_depth)) chart.stable_share = static_cast<double>(stable) / count;
  if (request.spread) other.addSpread(*system, chart);
  return chart;
}

// The spread is computed by the zero-order solution and applied as a ratio to the limits of the chart.
void ChartMaker::addSpread(const RegenerativeSystem& system, WhatIfChart& chart) const {
  constexpr int DRAWS = 40;
  constexpr unsigned SEED = 1;
  constexpr double LOW = 0.1, HIGH = 0.9;
  const std::vector<double>& speeds = chart.limit.spindle_speed;
  const DrawnLimits limits =
      drawnLimits(measuredSystem(system, modes_.at("x").model, modes_.at("y").model, *coefficients_), speeds,
                  DRAWS, SEED);
  std::vector<std::vector<double>> ratios(speeds.size());
  for (const std::vector<double>& drawn : limits.drawn)
    for (std::size_t k = 0; k < speeds.size(); ++k) ratios[k].push_back(drawn[k] / limits.mean[k]);
  for (std::size_t k = 0; k < speeds.size(); ++k) {
    std::sort(ratios[k].begin(), ratios[k].end());
    const auto at = [&](double share) { return ratios[k][static_cast<std::size_t>(share * (DRAWS - 1))]; };
    chart.limit_low.push_back(chart.limit.depth[k] * at(LOW));
    chart.limit_high.push_back(chart.limit.depth[k] * at(HIGH));
  }
}

}  // namespace smartmill::stability
