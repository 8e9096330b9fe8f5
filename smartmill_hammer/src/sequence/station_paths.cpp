#include "station_paths.h"

#include <algorithm>
#include <cmath>

#include "smartmill_core/axis_names.h"
#include "smartmill_core/model/station_axes.h"

namespace smartmill::hammer {

double roundTo(double value, double step) {
  return std::round(value / step) * step;
}

StationPaths::StationPaths(const HammerParameters& parameters, const MachineModel& model,
                           const std::string& direction)
    : parameters_(parameters),
      station_(StationAxes(model).toStation(model.hammer->position.at(direction))),
      along_(*axisIndex(direction)) {
  for (double& v : station_) v = roundTo(v, parameters.resolution);
  double height = station_[2] + parameters.retract_height;
  if (model.axes && model.axes->travel[2][1] > model.axes->travel[2][0])
    height = std::min(height, model.axes->travel[2][1]);
  safe_height_ = roundTo(height, parameters.resolution);
}

std::vector<Waypoint> StationPaths::approach(const Axes3& here) const {
  Axes3 above = station_;
  above[along_] -= parameters_.standoff;
  above[2] = std::max(safe_height_, here[2]);
  Axes3 up = here, level = above, near = station_;
  up[2] = above[2];
  level[2] = station_[2];
  near[along_] -= parameters_.near_path;
  return {{up, 0.0},
          {above, 0.0},
          {level, parameters_.approach_feed},
          {near, parameters_.approach_feed},
          {station_, parameters_.jog_feed}};
}

std::vector<Waypoint> StationPaths::toSecondHeight(const Axes3& here, double lowered) const {
  Axes3 away = here;
  for (std::size_t axis = 0; axis < 2; ++axis) away[axis] = station_[axis];
  Axes3 down = away;
  down[2] = station_[2] - lowered;
  return {{away, parameters_.jog_feed}, {down, parameters_.approach_feed}};
}

std::vector<Waypoint> StationPaths::retract(const Axes3& here) const {
  // Away from a second sensor first: sideways another flute would pass it.
  Axes3 off = here;
  off[across()] = roundTo(std::min(here[across()], station_[across()]), parameters_.resolution);
  Axes3 away = off;
  away[along_] =
      roundTo(std::min(here[along_], station_[along_] - parameters_.standoff), parameters_.resolution);
  Axes3 up = away;
  up[2] = std::max(here[2], safe_height_);
  return {{off, parameters_.approach_feed}, {away, parameters_.approach_feed}, {up, 0.0}};
}

}  // namespace smartmill::hammer
