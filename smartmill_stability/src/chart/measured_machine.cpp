#include "smartmill_stability/chart/measured_machine.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <complex>

#include "smartmill_core/error.h"
#include "smartmill_core/formatted.h"
#include "smartmill_core/units.h"
#include "smartmill_stability/chart/risk.h"
#include "smartmill_stability/solvers/cross_modes.h"

namespace smartmill::stability {
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

std::vector<SystemMode> modesOf(const WorkpieceModes& workpiece) {
  return systemModes(workpiece.x, workpiece.y);
}

/// Adds the receptance of the workpiece, which its reaction moves against the tool.
void addWorkpiece(const WorkpieceModes& workpiece, ToolTipResponse& response) {
  const std::vector<SystemMode> modes = modesOf(workpiece);
  for (std::size_t i = 0; i < response.frequency.size() && !modes.empty(); ++i) {
    const std::array<std::complex<double>, 4> added = receptance(modes, response.frequency[i]);
    response.xx[i] += added[0];
    response.yy[i] += added[3];
  }
}

bool needsModes(const ChartParameters& parameters) {
  return parameters.method == "collocation" || parameters.use_modes;
}

}  // namespace

void MeasuredMachine::use(const std::string& tool, double stamp) {
  if (tool != tool_) {
    frfs_.clear();
    modes_.clear();
    tool_ = tool;
  }
  stamp_ = std::max(stamp_, stamp);
}

void MeasuredMachine::handle(const MeasuredFrf& frf) {
  if (frf.point != POINT_TOOL_TIP) return;
  use(frf.tool, frf.stamp);
  frfs_[frf.direction] = frf;
}

void MeasuredMachine::handle(const MeasuredModes& modes) {
  if (modes.point != POINT_TOOL_TIP) return;
  use(modes.tool, modes.stamp);
  modes_[modes.direction] = modes;
}

void MeasuredMachine::handle(const CoefficientSet& coefficients) {
  stamp_ = std::max(stamp_, coefficients.stamp);
  coefficients_ = coefficients;
}

std::string MeasuredMachine::missing(const ChartParameters& parameters) const {
  std::string list;
  const auto need = [&](bool present, const std::string& what) {
    if (!present) list += (list.empty() ? "" : ", ") + what;
  };
  const bool limits_size = parameters.surface_tolerance > 0.0;
  for (const std::string direction : {"x", "y"}) {
    if (needsModes(parameters) || limits_size) need(modes_.count(direction) > 0, "modes in " + direction);
    if (!needsModes(parameters) && !byCollocation(parameters))
      need(frfs_.count(direction) > 0, "FRF in " + direction);
  }
  need(coefficients_ && coefficients_->value.ktc > 0.0, "tangential coefficient");
  if (limits_size) {
    need(coefficients_ && std::isfinite(coefficients_->value.kte + coefficients_->value.kre),
         "edge coefficients (surface_tolerance)");
  }
  return list;
}

bool MeasuredMachine::byCollocation(const ChartParameters& parameters) const {
  if (parameters.method != "auto") return parameters.method == "collocation";
  return fallbackReason(parameters).empty();
}

std::string MeasuredMachine::fallbackReason(const ChartParameters& parameters) const {
  if (parameters.method != "auto") return "";
  for (const char* direction : {"x", "y"}) {
    const auto found = modes_.find(direction);
    if (found == modes_.end() || found->second.model.modes.empty())
      return std::string("no modes in ") + direction;
    if (!(found->second.relative_error <= parameters.modes_error))
      return std::string("modes in ") + direction +
             formatted(": relative error of the fit %.2g, above modes_error %.2g",
                       found->second.relative_error, parameters.modes_error);
  }
  return "";
}

/// The cut without the dynamics of the tool.
RegenerativeSystem MeasuredMachine::cutOf(const ChartCut& cut, const Engagement& engagement) const {
  const CuttingCoefficients& cutting = coefficients_->value;
  const bool given = engagement.exit > engagement.entry;
  RegenerativeSystem system;
  system.teeth = cut.tool.teeth;
  system.pitch = cut.tool.pitch;
  system.helix = cut.tool.helix;
  system.diameter = cut.tool.diameter;
  system.edge = cut.tool.edge;
  system.entry = given ? engagement.entry : cut.parameters.entry;
  system.exit = given ? engagement.exit : cut.parameters.exit;
  system.kt = cutting.ktc;
  system.kr = std::isfinite(cutting.krc) ? cutting.krc : cut.parameters.radial_ratio * cutting.ktc;
  system.ka = cutting.kac;
  if (system.edge.inclined() && !std::isfinite(system.ka))
    throw Error("no chart yet, missing: axial coefficient (inclined edge)");
  if (system.edge.serrated()) {
    system.chip.emplace();
    system.chip->feed = cut.parameters.feed_per_tooth;
  }
  system.setProcessDamping(cut.process_damping);
  return system;
}

std::optional<RegenerativeSystem> MeasuredMachine::system(const ChartCut& cut,
                                                          const Engagement& engagement) const {
  if (!modes_.count("x") || !modes_.count("y") || !coefficients_ || !(coefficients_->value.ktc > 0.0))
    return {};
  RegenerativeSystem system = cutOf(cut, engagement);
  system.modes = crossModes(modes_.at("x").model, modes_.at("y").model, crossFrf(cut.parameters));
  for (const SystemMode& mode : modesOf(cut.workpiece)) system.modes.push_back(mode);
  return system;
}

std::optional<UncertainSystem> MeasuredMachine::uncertainSystem(const ChartCut& cut,
                                                                const Engagement& engagement) const {
  const std::optional<RegenerativeSystem> mean = system(cut, engagement);
  if (!mean) return {};
  LeastDeviations least;
  least.frequency = cut.parameters.frequency_std;
  least.damping = least.gain = least.cutting = cut.parameters.gain_std;
  least.radial = cut.parameters.radial_std;
  return measuredSystem(*mean, modes_.at("x").model, modes_.at("y").model, cut.workpiece, *coefficients_,
                        least);
}

/// The measured cross receptance, in either direction; empty without one.
FrequencyResponse MeasuredMachine::crossFrf(const ChartParameters& parameters) const {
  for (const char* direction : {"xy", "yx"}) {
    const auto found = frfs_.find(direction);
    if (found != frfs_.end() && found->second.frf.unit == "m/N")
      return certainLines(found->second.frf.band(parameters.frequency_low, parameters.frequency_high),
                          parameters.line_error, 0.0);
  }
  return {};
}

std::size_t MeasuredMachine::modesInX() const {
  return modes_.count("x") ? systemModes(modes_.at("x").model, 0).size() : 0;
}

ChartSolver MeasuredMachine::solver(const ChartCut& cut) const {
  const ChartParameters& parameters = cut.parameters;
  const std::string lacking = missing(parameters);
  if (!lacking.empty()) throw Error("no chart yet, missing: " + lacking);
  ChartSolver result;
  if (byCollocation(parameters)) {
    result.method = Method::collocation;
    result.system = *system(cut);
    // A limit beyond this depth does not restrict a recommended cut.
    result.max_depth = parameters.max_depth / (1.0 - parameters.depth_margin);
  } else {
    result.system = cutOf(cut, {});
    result.system.response = measuredResponse(parameters);
    addWorkpiece(cut.workpiece, *result.system.response);
  }
  return result;
}

/// Receptances of the tool tip for the zero-order solution.
ToolTipResponse MeasuredMachine::measuredResponse(const ChartParameters& parameters) const {
  constexpr std::size_t LINES = 20000;  // of the receptances of modes
  constexpr double STD_DEVS = 3.0;      // least value of a measured line
  if (parameters.use_modes)
    return responseOf(modes_.at("x").model, modes_.at("y").model, std::max(1.0, parameters.frequency_low),
                      parameters.frequency_high, LINES);
  const auto lines = [&](const char* direction) {
    return certainLines(frfs_.at(direction).frf.band(parameters.frequency_low, parameters.frequency_high),
                        parameters.line_error, STD_DEVS);
  };
  ToolTipResponse response = responseOf(lines("x"), lines("y"));
  addCross(frfs_, response);
  return response;
}

UncertainSystem MeasuredMachine::measuredSpread(const ChartCut& cut, const RegenerativeSystem& system) const {
  return measuredSystem(system, modes_.at("x").model, modes_.at("y").model, cut.workpiece, *coefficients_);
}

}  // namespace smartmill::stability
