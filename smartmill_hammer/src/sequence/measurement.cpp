#include "measurement.h"

#include <algorithm>

#include "smartmill_core/model/station_axes.h"
#include "smartmill_core/units.h"

namespace smartmill::hammer {
Measurement::Measurement(const HammerParameters& p, const MachineModel& model, const MeasureFrfGoal& g)
    : parameters(p),
      station(*model.hammer),
      tool(*model.tool),
      goal(g),
      paths(p, model, g.direction),
      turned(StationAxes(model).isTurned()),
      approach(
          station, tool,
          {p.sensor_face, p.curve_error, p.min_gap_share * station.gap_at_zero_volt, p.sensor_electrode}) {
}

double Measurement::leastPitch() const {
  double least = units::TWO_PI / teeth();
  if (teeth() == tool.teeth) {
    for (const double pitch : tool.pitch) least = std::min(least, pitch);
  }
  return least;
}

bool Measurement::correctsPerMode() const {
  return parameters.tip_correction == "apart" && goal.stickout > 0.0 &&
         station.offset + parameters.read_height > 0.0;
}

bool Measurement::needsSecondHeight() const {
  return correctsPerMode() && parameters.second_height != 0 &&
         lowered() > parameters.least_lowered_share * station.offset;
}

double Measurement::lowered() const {
  const double margin = goal.stickout - station.offset - parameters.read_height - parameters.least_shank;
  return roundTo(std::min(0.5 * station.offset, margin), parameters.resolution);
}

int Measurement::hitsRequired() const {
  return at_second_height ? std::min(goal.hits, std::max(parameters.second_height_hits, (goal.hits + 1) / 2))
                          : goal.hits;
}

double Measurement::hitProgress() const {
  const double from = at_second_height ? 0.87 : 0.7,
               to = at_second_height || !needsSecondHeight() ? 0.95 : 0.83;
  const std::size_t hits = (at_second_height ? second : first).hits.size();
  return from + (to - from) * static_cast<double>(hits) / hitsRequired();
}

double Measurement::rotationFromFlute(std::size_t axis) const {
  const double across = axis == paths.along() ? 0.0 : axis == 0 ? 0.5 * units::PI : -0.5 * units::PI;
  return result.flute_hammer - result.flute_low - across;
}

double Measurement::safeTravel(std::size_t axis, double moved) const {
  const double nominal = tool.lag();
  const double found = hasOffset() ? (result.flute_hammer - result.flute_low) / station.offset : nominal;
  const SensorApproach::Pose pose{rotationFromFlute(axis),
                                  parameters.read_height + (at_second_height ? lowered() : 0.0),
                                  std::min(found, nominal), std::max(found, nominal)};
  return approach.safeTravel(pose) - moved - swing.value_or(0.0);
}

void Measurement::report(const std::string& stage, double progress) {
  feedback = Feedback{stage, progress, static_cast<int>(first.hits.size() + second.hits.size())};
}

}  // namespace smartmill::hammer
