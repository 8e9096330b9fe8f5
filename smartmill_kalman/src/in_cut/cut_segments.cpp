#include "smartmill_kalman/in_cut/cut_segments.h"

#include <cmath>

#include "smartmill_core/cutting/rigid_cut.h"
#include "smartmill_core/error.h"
#include "smartmill_core/signal/force_channels.h"

namespace smartmill::kalman {
namespace {

constexpr const char* TOOL[] = {"tool_x", "tool_y"};

/// Start of the steady part of a record; force and response are not set.
CutSegment steady(const Record& record, const CampaignTest& test, double settling, std::size_t* from) {
  CutSegment cut;
  cut.name = test.name;
  cut.sample_rate = test.sample_rate;
  cut.speed = test.spindle_speed;
  const double begin = test.running_before ? 0.0 : test.engage_time.value_or(0.0) + settling;
  *from = static_cast<std::size_t>(std::ceil(begin * test.sample_rate));
  if (*from >= record.size())
    throw Error(record.file + ": ends before the cut is steady (" + test.name + ")");
  return cut;
}

std::vector<double> behind(const std::vector<double>& values, std::size_t from) {
  return {values.begin() + static_cast<std::ptrdiff_t>(from), values.end()};
}

}  // namespace

CutSegment toolSegment(const Record& record, const CampaignTest& test, std::size_t axis,
                       const ModalModel& sensor, double settling) {
  std::size_t from = 0;
  CutSegment cut = steady(record, test, settling, &from);
  if (record.has("spindle_angle")) cut.angle = behind(record.column("spindle_angle"), from);
  cut.force = behind(record.column(FORCE_CHANNELS[axis]), from);
  cut.response = behind(record.column(TOOL[axis]), from);
  cut.chain = sensor;
  return cut;
}

CutSegment sensorSegment(const Record& record, const CampaignTest& test, std::size_t axis,
                         const MachineModel& model, double relative_std, double settling) {
  std::size_t from = 0;
  CutSegment cut = steady(record, test, settling, &from);
  cut.angle = behind(record.column("spindle_angle"), from);
  cut.response = behind(record.column(FORCE_CHANNELS[axis]), from);
  if (!model.tool_tip.x.modes.empty() || !model.tool_tip.y.modes.empty())
    throw Error(model.file +
                ": tool_tip: has modes, expected a rigid tool (the predicted force excludes vibration)");
  const ToolGeometry& tool = model.needTool("predict the cutting force");
  CuttingLaw law;
  law.coefficients = model.needCutting("predict the cutting force");
  if (!test.engagement) throw Error(test.name + ": no engagement");
  RigidCut rigid(tool, law, *test.engagement, {}, test.feed_direction);
  cut.force.reserve(cut.angle.size());
  for (const double angle : cut.angle) {
    const CuttingForce force = rigid.at(angle);
    cut.force.push_back(axis == 0 ? force.fx : axis == 1 ? force.fy : force.fz);
  }
  cut.relative_force_std = relative_std;
  cut.every = tool.teeth;
  return cut;
}

}  // namespace smartmill::kalman
