#include "smartmill_discrepancy/explain/inspection_check.h"

#include <algorithm>
#include <cmath>

#include "smartmill_core/formatted.h"
#include "smartmill_core/units.h"
#include "smartmill_sim/effects/effect_set.h"

namespace smartmill::discrepancy {
namespace {

/// Geometry of a cut as the effects of a model change it.
struct CutGeometry {
  double radius = 0.0;       ///< [m] of the outermost tooth
  double depth_extra = 0.0;  ///< [m]
};

CutGeometry geometryOf(const MachineModel& model, const CampaignTest& test) {
  const sim::EffectSet effects(model);
  const TwinSetup setup = sim::setUpOf(model, effects);
  TwinState state;
  state.radius = setup.model.tool->radius();
  if (setup.model.cutting) state.law.coefficients = *setup.model.cutting;
  Instant now;
  now.speed = test.spindle_speed;
  now.start_time = test.start_time.value_or(0.0);
  now.edge_time = test.cut_time_before.value_or(0.0);
  now.chip = test.engagement->feed_per_tooth;
  now.depth = test.engagement->axial_depth;
  effects.update(now, state);
  const std::vector<double>& offset = setup.radius_offset;
  const double outermost = offset.empty() ? 0.0 : *std::max_element(offset.begin(), offset.end());
  return {state.radius + outermost, state.depth_extra};
}

}  // namespace

bool InspectedDimension::agrees(double predicted) const {
  constexpr double DEVIATIONS = 1.96;  // 95 %
  return std::abs(measured - predicted) <= DEVIATIONS * std_dev;
}

std::string InspectionCheck::text() const {
  if (dimensions.empty()) return "";
  const auto count = [this](auto agrees) {
    return std::count_if(dimensions.begin(), dimensions.end(), agrees);
  };
  return formatted("%zu inspected dimensions: the stated model agrees with %td, the improved one with %td",
                   dimensions.size(), count([](const auto& d) { return d.agreesBefore(); }),
                   count([](const auto& d) { return d.agreesAfter(); }));
}

InspectionCheck checkInspection(const InspectionFile& inspection, const std::vector<CampaignTest>& tests,
                                const MachineModel& stated, const MachineModel& improved) {
  InspectionCheck check;
  for (const InspectionFile::Dimension& dimension : inspection.features) {
    const InspectionFeature& feature = dimension.feature;
    const auto omit = [&](const std::string& reason) {
      check.notes.push_back("inspection, " + dimension.path + ": not used: " + reason);
    };
    const auto test = std::find_if(tests.begin(), tests.end(), [&](const CampaignTest& t) {
      return t.name == feature.condition && t.kind == TestKind::cut && t.engagement;
    });
    if (test == tests.end()) {
      omit("'" + feature.condition + "' is no cut of the campaign");
      continue;
    }
    const bool is_width = feature.kind == SLOT_WIDTH;
    if (!is_width && feature.direction != "z") {
      omit("no effect of the catalogue moves a face along " + feature.direction);
      continue;
    }
    const double nominal_radius = stated.needTool("compare the inspected dimensions").radius();
    const auto predicted = [&](const MachineModel& model) {
      const CutGeometry cut = geometryOf(model, *test);
      return is_width ? 2.0 * (cut.radius - nominal_radius) : -cut.depth_extra;
    };
    check.dimensions.push_back({feature.condition, feature.kind, feature.direction, feature.deviation(),
                                feature.std_dev, predicted(stated), predicted(improved)});
  }
  return check;
}

}  // namespace smartmill::discrepancy
