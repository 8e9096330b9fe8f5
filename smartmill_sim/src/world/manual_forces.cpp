#include "smartmill_sim/world/manual_forces.h"

#include "smartmill_core/frames.h"

namespace smartmill::sim {

void ManualForces::hit(bool on_tool, std::size_t axis, const Hit& hit) {
  (on_tool ? tool_ : workpiece_) = {hit, axis};
}

bool ManualForces::hitting(double time) const {
  return (workpiece_.hit && !workpiece_.hit->over(time)) || (tool_.hit && !tool_.hit->over(time));
}

void ManualForces::pull(const Vector& force, bool on_table) {
  pull_ = force;
  pull_on_table_ = on_table;
}

ManualForces::Forces ManualForces::at(double time) const {
  Forces forces;
  forces.tip = pull_;
  if (workpiece_.hit) {
    forces.hammer = forces.workpiece[workpiece_.axis] = workpiece_.hit->force(time);
    forces.workpiece = frames::rotate(from_sensor, forces.workpiece);
  }
  if (tool_.hit) {
    const double hit = tool_.hit->force(time);
    forces.tip[tool_.axis] += hit;
    if (tool_.axis < 2) forces.tip_hit[tool_.axis] = hit;
    forces.hammer += hit;
  }
  forces.table = forces.workpiece;
  for (std::size_t axis = 0; axis < 3 && pull_on_table_; ++axis) forces.table[axis] += pull_[axis];
  return forces;
}

void ManualForces::skipTime(double time) {
  for (AxisHit* h : {&workpiece_, &tool_}) {
    if (h->hit) h->hit->begin += time;
  }
}

}  // namespace smartmill::sim
