#include "smartmill_loadmeter/inspection/inspection_record.h"

#include <algorithm>
#include <cmath>

#include "smartmill_core/axis_names.h"
#include "smartmill_core/error.h"
#include "smartmill_core/formatted.h"
#include "smartmill_core/require.h"
#include "smartmill_core/units.h"
#include "smartmill_loadmeter/inspection/slot_deflection.h"

namespace smartmill::loadmeter {

namespace {

constexpr double SAME_DIAMETER = 1e-6;                            // [m]
const Range PART_TEMPERATURE = Range::closed(253.15, 353.15);     // [K] -20..80 deg C
const Range EXPANSION = Range::openLow(0.0, 1e-4);                // [1/K] of solids; aluminium 23e-6
const Range MACHINE_TEMPERATURE = Range::closed(253.15, 453.15);  // [K] up to insulation of class H

void requireIfStated(const char* key, double value, const Range& range, const char* unit) {
  if (!std::isnan(value)) require(key, value, range, unit);
}

// Rules for the feature itself.
void check(const InspectionFeature& f, const InspectionParameters& parameters) {
  if (f.kind != SLOT_WIDTH && f.kind != STEP_POSITION)
    throw Error("kind: '" + f.kind + "', expected " + SLOT_WIDTH + " or " + STEP_POSITION);
  const std::optional<std::size_t> axis = axisIndex(f.direction);
  if (!axis) throw Error("direction: '" + f.direction + "', expected x, y or z");
  if (f.kind == SLOT_WIDTH && *axis == 2) throw Error("direction: 'z', expected x or y of a slot's width");
  require("stamp", f.stamp, Range::positive(), "s");
  require("nominal", f.nominal, f.kind == SLOT_WIDTH ? Range::positive() : Range(), "m");
  require("measured", f.measured, f.kind == SLOT_WIDTH ? Range::positive() : Range(), "m");
  require("std_dev", f.std_dev, Range::openLow(0.0, parameters.largest_difference), "m");
  const double difference = std::abs(f.measured - f.nominal);
  if (difference > parameters.largest_difference) {
    throw Error(formatted("measured: %.4f mm from nominal, expected at most %.4f mm (wrong feature or unit?)",
                          difference / units::MM, parameters.largest_difference / units::MM));
  }
  requireIfStated("cut_stamp", f.cut_time, Range::openLow(0.0, f.stamp), "s");
  requireIfStated("machine_temperature", f.machine_temperature, MACHINE_TEMPERATURE, "K");
  requireIfStated("part_temperature", f.part_temperature, PART_TEMPERATURE, "K");
  requireIfStated("part_expansion", f.part_expansion, EXPANSION, "1/K");
  if (std::isnan(f.part_temperature) != std::isnan(f.part_expansion))
    throw Error("part_temperature and part_expansion: one without the other, expected both or none");
}

bool isFullSlot(const CuttingCondition& cut, const InspectionRecord& record) {
  constexpr double SAME_ANGLE = 1e-3;  // [rad]
  return std::abs(record.nominal - record.diameter) <= SAME_DIAMETER && cut.engagement.entry <= SAME_ANGLE &&
         cut.engagement.exit >= units::PI - SAME_ANGLE;
}

bool isComplete(const CuttingCoefficients& k) {
  return std::isfinite(k.ktc) && std::isfinite(k.krc) && std::isfinite(k.kte) && std::isfinite(k.kre);
}

struct Coefficients {
  CuttingCoefficients value;
  double uncertainty = 0.0;  // [1] of the across force
};

// Of the pair in the database; else of the model, whose cutting section is of its tool and material.
std::optional<Coefficients> coefficientsOf(const CuttingCondition& cut, const MachineModel& model,
                                           const CoefficientDatabase& database) {
  const auto with = [](CuttingCoefficients value, double uncertainty) {
    if (!std::isfinite(value.kac)) value.kac = 0.0;  // axial forces do not deflect the tool across the feed
    if (!std::isfinite(value.kae)) value.kae = 0.0;
    return Coefficients{value, uncertainty};
  };
  if (const auto stored = database.find(cut.tool_name, cut.material); stored && isComplete(stored->value)) {
    const auto relative = [](double std_dev, double value) {
      return std::isfinite(std_dev) && value != 0.0 ? std::abs(std_dev / value) : 0.0;
    };
    return with(stored->value, std::max(relative(stored->std_dev.ktc, stored->value.ktc),
                                        relative(stored->std_dev.krc, stored->value.krc)));
  }
  if (model.cutting && isComplete(*model.cutting))
    return with(*model.cutting, 0.01 * model.uncertainty.cutting);
  return std::nullopt;
}

}  // namespace

InspectionRecord recordOf(const InspectionFeature& f, const InspectedCut& cut,
                          const InspectionParameters& parameters) {
  check(f, parameters);
  const CuttingCondition& c = cut.condition;
  if (f.stamp < c.stamp)
    throw Error(formatted("stamp: inspected at %.3f s, before its cut at %.3f s", f.stamp, c.stamp));
  if (f.kind == SLOT_WIDTH && f.nominal < c.tool.diameter - SAME_DIAMETER) {
    throw Error(formatted("nominal: %.4f mm, narrower than the tool of %.4f mm", f.nominal / units::MM,
                          c.tool.diameter / units::MM));
  }
  InspectionRecord record;
  record.tool = c.tool_name;
  record.material = c.material;
  record.condition = f.condition;
  record.kind = f.kind;
  record.direction = f.direction;
  record.stamp = f.stamp;
  record.diameter = c.tool.diameter;
  record.nominal = f.nominal;
  record.measured = f.measured;
  record.std_dev = f.std_dev;
  record.cut_time = f.cut_time;
  record.machine_temperature = f.machine_temperature;
  record.part_temperature = f.part_temperature;
  record.part_expansion = f.part_expansion;
  record.edge_age = cut.edge_age;
  return record;
}

InspectionResult inspect(const InspectionFeature& feature, const CutHistory& cuts,
                         const InspectionParameters& parameters) {
  InspectionResult result;
  try {
    if (feature.condition.empty()) throw Error("condition: empty, expected the name of a cut");
    const InspectedCut& cut = cuts.find(feature.condition, feature.cut_time);
    result.condition = cut.condition;
    result.record = recordOf(feature, cut, parameters);
    result.record.cut_time = cut.condition.stamp;
    const TemperatureReading& temperature = cut.temperature[*axisIndex(feature.direction)];
    if (std::isnan(feature.machine_temperature)) result.record.machine_temperature = temperature.value;
    if (feature.kind == STEP_POSITION && std::isnan(result.record.machine_temperature))
      result.note = "not used for thermal growth: " +
                    (temperature.fault.empty() ? "no temperature reported" : temperature.fault);
  } catch (const Error& error) {
    result.refusal = "'" + feature.condition + "': " + error.what();
  }
  return result;
}

std::string setDeflection(const CuttingCondition& cut, const MachineModel& model,
                          const CoefficientDatabase& database, InspectionRecord* record) {
  if (record->kind != SLOT_WIDTH) return {};
  if (!isFullSlot(cut, *record)) return "no slot as wide as the tool";
  if (!(cut.engagement.axial_depth > 0.0) || !(cut.engagement.feed_per_tooth > 0.0) ||
      !(cut.spindle_speed > 0.0))
    return "speed, feed and depth of the cut are not stated";
  const ModalModel& across = record->direction == "x" ? model.tool_tip.x : model.tool_tip.y;
  if (across.modes.empty()) return "the model states no modes of the tool tip along " + record->direction;
  if (!model.tool || model.tool->teeth != cut.tool.teeth ||
      std::abs(model.tool->diameter - cut.tool.diameter) > SAME_DIAMETER)
    return "the modes of the tool tip are those of another tool";
  const std::optional<Coefficients> k = coefficientsOf(cut, model, database);
  if (!k) return "no tangential and radial coefficients of '" + cut.tool_name + "' in '" + cut.material + "'";
  const Estimate widening = slotWidening(cut, k->value, k->uncertainty, across, model.uncertainty);
  record->deflection = widening.value;
  record->deflection_std = widening.std_dev;
  return {};
}

}  // namespace smartmill::loadmeter
