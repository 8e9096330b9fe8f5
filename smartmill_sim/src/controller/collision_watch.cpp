#include "smartmill_sim/controller/collision_watch.h"

#include <algorithm>

#include "smartmill_sim/controller/nc_alarm.h"

namespace smartmill::sim {
namespace {

constexpr double FAR = 10.0;  // [m]

}  // namespace

CollisionWatch CollisionWatch::ofModel(const MachineModel& model, const CollisionOptions& options) {
  CollisionWatch watch;
  if (!model.tool) return watch;
  watch.tool_radius = model.tool->radius();
  watch.core_radius = watch.tool_radius;
  if (model.hammer) {
    watch.core_radius = std::max(0.0, watch.tool_radius - model.hammer->flute_depth);
    const HammerStation& station = *model.hammer;
    watch.axes_ = StationAxes(model);
    for (const auto& entry : station.position) {
      const std::string& direction = entry.first;
      const Axes3 station_position = watch.axes_.toStation(entry.second);
      const std::size_t along = direction == "y" ? 1 : 0;
      const std::size_t across = 1 - along;
      const auto body = [&](const std::string& name, double behind, double half_width, double low,
                            double high) {
        Body b{name + " " + direction, station_position, station_position};
        b.low[along] = station_position[along] + watch.tool_radius + behind;
        b.high[along] = b.low[along] + options.body_length;
        b.low[across] = station_position[across] - half_width;
        b.high[across] = station_position[across] + half_width;
        b.low[2] = low;
        b.high[2] = high;
        watch.add(b);
      };
      const double face = options.face_gaps * station.gap_at_zero_volt;
      // No body in front of the face: the tool turns there.
      body("SENSOR", face, options.sensor_half_width, -FAR, station_position[2] + options.sensor_above_tip);
      body("HAMMER", face + options.plunger, options.hammer_half_width,
           station_position[2] + options.sensor_above_tip,
           station_position[2] + station.offset + options.hammer_half_width);
    }
  }
  if (model.workpiece) watch.add({"TABLE", {-FAR, -FAR, -FAR}, {FAR, FAR, model.workpiece->low[2]}});
  return watch;
}

std::optional<focas::AlarmMessage> CollisionWatch::check(const MotionState& state) const {
  const Body* body = collidingBody(state.position, state.spindle_speed != 0.0);
  if (!body) return std::nullopt;
  return focas::AlarmMessage{EX_COLLISION, ALARM_EX, 0, "TOOL MET " + body->name};
}

const CollisionWatch::Body* CollisionWatch::collidingBody(const Axes3& position, bool turning) const {
  const double radius = turning ? tool_radius : core_radius;
  const Axes3 centre = axes_.toStation(position);
  for (const Body& body : bodies_) {
    if (position[2] >= body.high[2]) {
      continue;  // the whole tool is above it
    }
    double square = 0.0;
    for (std::size_t i = 0; i < 2; ++i) {
      const double nearest = std::clamp(centre[i], body.low[i], body.high[i]);
      square += (centre[i] - nearest) * (centre[i] - nearest);
    }
    if (square < radius * radius) return &body;
  }
  return nullptr;
}

}  // namespace smartmill::sim
