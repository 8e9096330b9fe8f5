#include "smartmill_core/io/inspection_file.h"

#include <algorithm>
#include <iterator>
#include <map>

#include "smartmill_core/error.h"
#include "smartmill_core/model/strict_yaml.h"
#include "smartmill_core/signal/machine_temperature.h"
#include "smartmill_core/units.h"

namespace smartmill {

namespace {

constexpr const char* FORMAT = "smartmill-inspection/1";
constexpr const char* SLOT_KEYS[] = {"teeth", "helix_deg", "spindle_speed_rpm", "axial_depth_mm",
                                     "feed_per_tooth_mm"};

InspectionFile::Cut readCut(const StrictYaml& map) {
  InspectionFile::Cut cut;
  CuttingCondition& c = cut.condition;
  c.kind = CuttingCondition::Kind::cut;
  c.name = map.word("name");
  c.tool_name = map.word("tool");
  c.material = map.word("material");
  c.tool.diameter = map.number("diameter_mm", Range::positive()) * units::MM;
  if (const auto before = map.optionalNumber("cut_time_before_s", Range::notNegative()))
    cut.edge_age = *before;
  // A full slot, whose deflection can be corrected; all keys or none.
  const auto isStated = [&map](const char* key) { return map.has(key); };
  if (std::any_of(std::begin(SLOT_KEYS), std::end(SLOT_KEYS), isStated)) {
    c.tool.teeth = map.integer("teeth", 1, 20);
    c.tool.helix = units::radFromDeg(map.number("helix_deg", Range::openHigh(0.0, 80.0)));
    c.spindle_speed = units::radPerSecFromRpm(map.number("spindle_speed_rpm", Range::positive()));
    c.engagement = {0.0, units::PI, map.number("axial_depth_mm", Range::positive()) * units::MM,
                    map.number("feed_per_tooth_mm", Range::positive()) * units::MM};
  }
  map.finish();
  return cut;
}

InspectionFeature readFeature(const StrictYaml& map, double stamp) {
  InspectionFeature f;
  f.stamp = stamp;
  f.condition = map.word("cut");
  f.kind = map.oneOf("kind", {SLOT_WIDTH, STEP_POSITION});
  f.direction = map.oneOf("direction", {"x", "y", "z"});
  f.nominal = map.number("nominal_mm") * units::MM;
  f.measured = map.number("measured_mm") * units::MM;
  f.std_dev = map.number("std_um", Range::positive()) * units::UM;
  const auto optional = [&map](const char* key, double unit, double zero, double* value) {
    if (const auto stated = map.optionalNumber(key)) *value = *stated * unit + zero;
  };
  optional("cut_time_s", 1.0, 0.0, &f.cut_time);
  optional("machine_temperature_c", 1.0, ZERO_CELSIUS, &f.machine_temperature);
  optional("part_temperature_c", 1.0, ZERO_CELSIUS, &f.part_temperature);
  optional("part_expansion_um_per_m_k", units::UM, 0.0, &f.part_expansion);
  map.finish();
  return f;
}

}  // namespace

InspectionFile readInspectionFile(const std::string& file) {
  const StrictYaml root = StrictYaml::fromFile(file);
  root.oneOf("format", {FORMAT});
  const double stamp = root.number("stamp_s", Range::positive());
  InspectionFile read;
  for (const StrictYaml& map : root.maps("cuts")) {
    const InspectionFile::Cut cut = readCut(map);
    if (!read.cuts.emplace(cut.condition.name, cut).second)
      map.fail("name", "'" + cut.condition.name + "' is the name of two cuts");
  }
  for (const StrictYaml& map : root.maps("features")) {
    const InspectionFeature feature = readFeature(map, stamp);
    if (read.cuts.count(feature.condition) == 0)
      map.fail("cut", "'" + feature.condition + "' is not among the cuts");
    std::string path = map.path("");
    path.pop_back();  // the dot
    read.features.push_back({feature, path});
  }
  root.finish();
  return read;
}

}  // namespace smartmill
