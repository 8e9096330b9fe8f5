#include "smartmill_loadmeter/inspection/inspection_evidence.h"

#include <Eigen/Dense>

#include <algorithm>
#include <cmath>
#include <map>
#include <tuple>

#include "smartmill_core/formatted.h"
#include "smartmill_core/signal/inspection_feature.h"
#include "smartmill_core/units.h"
#include "weighted_fit.h"

namespace smartmill::loadmeter {

namespace {

using Records = std::vector<InspectionRecord>;

constexpr std::size_t FEWEST_POSITIONS = 3;  // a line through two checks nothing
constexpr int WEIGHT_PASSES = 3;             // the weights depend on the growth, to second order

std::string plural(std::size_t count, const std::string& what) {
  return std::to_string(count) + " " + what + (count == 1 ? "" : "s");
}

// Announces what the fit did.
std::vector<std::string> notesOf(const WeightedFit& fit, const Records& records) {
  std::vector<std::string> notes;
  for (const WeightedFit::Refused& r : fit.refused)
    notes.push_back(formatted("'%s' refused: %.1f um from the others, %.1f standard deviations",
                              records[r.row].condition.c_str(), r.deviation / units::UM, r.sigmas));
  if (fit.found() && fit.widened > 1.0)
    notes.push_back(
        formatted("they scatter %.1f times as much as stated: standard deviation widened", fit.widened));
  return notes;
}

RadiusEvidence radiusOf(const Records& slots, const InspectionParameters& parameters) {
  RadiusEvidence found;
  found.machine = slots.front().machine;
  found.tool = slots.front().tool;
  found.diameter = slots.front().diameter;
  const auto count = static_cast<Eigen::Index>(slots.size());
  Eigen::VectorXd value(count), std_dev(count);
  for (Eigen::Index i = 0; i < count; ++i) {
    const InspectionRecord& slot = slots[static_cast<std::size_t>(i)];
    const double deflection = std::isfinite(slot.deflection) ? slot.deflection : 0.0;
    value[i] = 0.5 * (slot.deviation() - deflection);
    std_dev[i] = 0.5 * slot.std_dev;
  }
  const WeightedFit fit =
      fitWeighted(Eigen::MatrixXd::Ones(count, 1), value, std_dev, parameters.outlier, "slot widths");
  found.notes = notesOf(fit, slots);
  found.problem = fit.problem;
  if (!fit.found()) return found;
  // The deflections of all slots have the same errors.
  double common = 0.0, weights = 0.0;
  for (std::size_t i = 0; i < slots.size(); ++i) {
    if (fit.weight[i] == 0.0) continue;
    ++found.used;
    weights += fit.weight[i];
    if (!std::isfinite(slots[i].deflection)) continue;
    ++found.corrected;
    common += fit.weight[i] * 0.5 * slots[i].deflection_std;
  }
  found.deviation = {fit.value[0], std::hypot(std::sqrt(fit.covariance(0, 0)), common / weights)};
  return found;
}

// Positions over temperature.
struct Positions {
  explicit Positions(const Records& steps)
      : position(size(steps)), std_dev(size(steps)), temperature(size(steps)) {
    for (Eigen::Index i = 0; i < position.size(); ++i) {
      const InspectionRecord& step = steps[static_cast<std::size_t>(i)];
      position[i] = step.deviation();
      std_dev[i] = step.std_dev;
      temperature[i] = step.machine_temperature;
    }
  }

  // Offset at the mean temperature, and growth.
  WeightedFit fit(const InspectionParameters& parameters) const {
    Eigen::MatrixXd design = Eigen::MatrixXd::Ones(position.size(), 2);
    design.col(1) = temperature.array() - temperature.mean();
    WeightedFit found;
    double growth = 0.0;
    for (int pass = 0; pass < WEIGHT_PASSES; ++pass) {
      const double by_temperature = growth * parameters.temperature_std;
      const Eigen::VectorXd total = (std_dev.array().square() + by_temperature * by_temperature).sqrt();
      found = fitWeighted(design, position, total, parameters.outlier, "positions");
      if (!found.found()) break;
      growth = found.value[1];
    }
    return found;
  }

  static Eigen::Index size(const Records& steps) { return static_cast<Eigen::Index>(steps.size()); }

  Eigen::VectorXd position, std_dev, temperature;  // [m], [m], [K]
};

// Sets the range of the temperatures. @return whether a growth can be estimated; else the problem is set
bool isSpread(const std::vector<double>& temperatures, double least, GrowthEvidence* found) {
  const auto [lowest, highest] = std::minmax_element(temperatures.begin(), temperatures.end());
  found->lowest = *lowest;
  found->highest = *highest;
  if (*highest - *lowest >= least) return true;
  found->problem = formatted("temperatures from %.1f to %.1f K differ by %.1f K, expected %.1f K or more",
                             *lowest, *highest, *highest - *lowest, least);
  return false;
}

GrowthEvidence growthOf(const Records& all, const InspectionParameters& parameters) {
  GrowthEvidence found;
  found.machine = all.front().machine;
  found.tool = all.front().tool;
  found.axis = all.front().direction;
  Records steps;
  std::vector<double> temperatures;
  for (const InspectionRecord& r : all) {
    if (!std::isfinite(r.machine_temperature)) continue;
    steps.push_back(r);
    temperatures.push_back(r.machine_temperature);
  }
  if (steps.size() < all.size())
    found.notes.push_back(plural(all.size() - steps.size(), "position") + " without temperature not used");
  if (steps.size() < FEWEST_POSITIONS) {
    found.problem = plural(steps.size(), "position") +
                    formatted(" with temperature, expected %zu or more", FEWEST_POSITIONS);
    return found;
  }
  if (!isSpread(temperatures, parameters.least_temperature_spread, &found)) return found;
  const WeightedFit fit = Positions(steps).fit(parameters);
  for (std::string& note : notesOf(fit, steps)) found.notes.push_back(std::move(note));
  found.problem = fit.problem;
  if (!fit.found()) return found;
  temperatures.clear();
  for (std::size_t i = 0; i < steps.size(); ++i)
    if (fit.weight[i] != 0.0) temperatures.push_back(steps[i].machine_temperature);
  found.used = temperatures.size();
  if (!isSpread(temperatures, parameters.least_temperature_spread, &found)) return found;
  found.coefficient = {fit.value[1], std::sqrt(fit.covariance(1, 1))};
  return found;
}

std::string headOf(const std::string& machine, const std::string& tool) {
  return (machine.empty() ? "" : machine + ": ") + tool + ": ";
}

}  // namespace

std::string RadiusEvidence::text() const {
  const std::string head = headOf(machine, tool) + "effective radius: ";
  if (!problem.empty()) return head + problem;
  return head +
         formatted("%.4f +- %.4f mm, %+.1f um from the stated one, from %s, corrected for deflection: %s",
                   (0.5 * diameter + deviation.value) / units::MM, deviation.std_dev / units::MM,
                   deviation.value / units::UM, plural(used, "slot width").c_str(),
                   corrected == used ? "all"
                   : corrected == 0  ? "none"
                                     : std::to_string(corrected).c_str());
}

std::string GrowthEvidence::text() const {
  const std::string head = headOf(machine, tool) + "thermal growth along " + axis + ": ";
  if (!problem.empty()) return head + problem;
  return head + formatted("%.2f +- %.2f um/K from %s at %.1f to %.1f K", coefficient.value / units::UM,
                          coefficient.std_dev / units::UM, plural(used, "position").c_str(), lowest, highest);
}

std::vector<std::string> InspectionEvidence::lines() const {
  std::vector<std::string> all;
  const auto add = [&all](const auto& evidence) {
    for (const auto& one : evidence) {
      all.push_back(one.text());
      for (const std::string& note : one.notes) all.push_back("  " + note);
    }
  };
  add(radii);
  add(growths);
  return all;
}

InspectionEvidence inspectionEvidence(const Records& records, const InspectionParameters& parameters) {
  std::map<std::tuple<std::string, std::string, double>, Records> slots;
  std::map<std::tuple<std::string, std::string, std::string>, Records> steps;
  for (const InspectionRecord& r : records) {
    if (r.kind == SLOT_WIDTH) slots[{r.machine, r.tool, r.diameter}].push_back(r);
    if (r.kind == STEP_POSITION) steps[{r.machine, r.tool, r.direction}].push_back(r);
  }
  InspectionEvidence evidence;
  for (const auto& [of, group] : slots) evidence.radii.push_back(radiusOf(group, parameters));
  for (const auto& [of, group] : steps) evidence.growths.push_back(growthOf(group, parameters));
  return evidence;
}

}  // namespace smartmill::loadmeter
