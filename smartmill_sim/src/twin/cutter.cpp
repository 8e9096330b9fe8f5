#include "smartmill_sim/twin/cutter.h"

#include <algorithm>

#include <Eigen/Core>
#include <Eigen/LU>

namespace smartmill::sim {

Cutter::Cutter(const ToolGeometry& tool, const CuttingLaw& law, double time_step,
               const std::vector<double>& radius_offset, double corner_radius, double path_share, Way way,
               int corner_slices)
    : way_(way), corner_radius_(corner_radius), lag_(tool.lag()), law_(law) {
  for (const EdgeSlice& slice : edgeSlices(tool, corner_radius, corner_slices)) {
    Part part;
    part.slice = part.actual = slice;
    part.top = slice.high;
    const ToolGeometry straight = toolOf(slice, tool);
    if (way == Way::tables) {
      part.rigid.emplace(straight, lawOf(slice, law), radius_offset, path_share);
    } else {
      part.process.emplace(straight, lawOf(slice, law), time_step, radius_offset, path_share);
    }
    parts_.push_back(std::move(part));
  }
}

// The edge of a slice is the edge of a tip whose angle lags accordingly.
ToolMotion Cutter::motionOf(const Part& part, const ToolMotion& now) const {
  ToolMotion motion = now;
  motion.angle -= lag_ * part.slice.low;
  return motion;
}

// Intersects the arcs with the height of a slice.
void Cutter::place(Part& part) {
  std::vector<ContactArc> arcs;
  double top = 0.0;
  for (const ContactArc& arc : arcs_) {
    const double height = std::min(arc.depth, part.slice.high);
    if (height <= part.slice.low) continue;
    arcs.push_back({arc.entry, arc.exit, height - part.slice.low});
    top = std::max(top, height);
  }
  const bool leans = part.slice.high <= corner_radius_ * (1.0 + 1e-9);
  if (leans && !arcs.empty() && top != part.top) {
    part.top = top;
    part.actual = top == part.slice.high ? part.slice : upTo(top, part.slice, corner_radius_);
    const CuttingLaw law = lawOf(part.actual, law_);
    if (part.process) part.process->setLaw(law);
    if (part.rigid) part.rigid->setLaw(law);
  }
  if (fresh_ || arcs.size() != part.arcs) {
    if (part.process) part.process->engage(arcs, motionOf(part, now_));
    if (part.rigid) part.rigid->engage(arcs, feedOf(now_));
    part.arcs = arcs.size();
    return;
  }
  std::vector<double> depths;
  for (const ContactArc& arc : arcs) depths.push_back(arc.depth);
  if (part.process) part.process->setDepths(depths);
  if (part.rigid) part.rigid->setDepths(depths);
}

void Cutter::engage(const std::vector<ContactArc>& arcs, const ToolMotion& now) {
  arcs_ = arcs;
  now_ = now;
  fresh_ = true;
  for (Part& part : parts_) place(part);
  fresh_ = false;
}

void Cutter::setDepths(const std::vector<double>& depths) {
  for (std::size_t a = 0; a < arcs_.size(); ++a) arcs_[a].depth = depths.at(a);
  for (Part& part : parts_) place(part);
}

void Cutter::setLaw(const CuttingLaw& law) {
  law_ = law;
  for (Part& part : parts_) {
    const CuttingLaw own = lawOf(part.actual, law);
    if (part.process) part.process->setLaw(own);
    if (part.rigid) part.rigid->setLaw(own);
  }
}

CutSums Cutter::sumsOf(Part& part, const ToolMotion& now) const {
  if (part.process) return part.process->sumsAt(part.slice.low == 0.0 ? now : motionOf(part, now));
  CutSums sums;
  sums.edges = part.rigid->sumsAt(now.angle - lag_ * part.slice.low);
  return sums;
}

CuttingForce Cutter::force() const {
  CuttingForce sum;
  for (const Part& part : parts_) {
    if (part.arcs == 0) continue;
    sum.add(part.rigid ? part.rigid->force(part.sums.edges) : part.process->force(part.sums));
  }
  return sum;
}

// The force is linear in the rate and the rate in the force: a linear system of two equations.
void Cutter::yieldTo(const ToolMotion& now, const TipYield& yield) {
  const auto forceAt = [&](const Eigen::Vector2d& rate) -> Eigen::Vector2d {
    for (Part& part : parts_) {
      if (part.arcs > 0) part.sums.rubbing = part.process->rubbing({{rate[0], rate[1]}}, now.speed);
    }
    const CuttingForce f = force();
    return {f.fx, f.fy};
  };
  const Eigen::Vector2d assumed(yield.assumed[0], yield.assumed[1]), told(now.rate[0], now.rate[1]);
  const Eigen::DiagonalMatrix<double, 2> gives(yield.rate[0], yield.rate[1]);
  const Eigen::Vector2d still = forceAt({0.0, 0.0});
  Eigen::Matrix2d rises;
  rises << forceAt({1.0, 0.0}) - still, forceAt({0.0, 1.0}) - still;
  const Eigen::Matrix2d whole = Eigen::Matrix2d::Identity() - gives * rises;
  forceAt(whole.inverse() * (told + gives * (still - assumed)));
}

CuttingForce Cutter::step(const ToolMotion& now, const TipYield& yield) {
  if (parts_.size() > 1) now_ = now;  // a change of depth may engage another slice
  for (Part& part : parts_) {
    if (part.arcs == 0) continue;
    part.sums = followed_ ? followed_->at(place_++) : sumsOf(part, now);
  }
  const bool yields = yield.rate[0] != 0.0 || yield.rate[1] != 0.0;
  if (!followed_ && yields && law_.damping != 0.0) yieldTo(now, yield);
  for (const Part& part : parts_) {
    if (kept_ && part.arcs > 0) kept_->push_back(part.sums);
  }
  return force();
}

void Cutter::settle(const std::array<double, 2>& displacement) {
  for (Part& part : parts_) {
    if (part.process && !followed_) part.process->settle(displacement);
  }
}

}  // namespace smartmill::sim
