#include "smartmill_sim/twin/cutter.h"

#include <algorithm>

#include <Eigen/Core>
#include <Eigen/LU>

#include "smartmill_core/error.h"

namespace smartmill::sim {

Cutter::Cutter(const ToolGeometry& tool, const CuttingLaw& law, double time_step,
               const std::vector<double>& radius_offset, double path_share, Method method, int corner_slices)
    : tool_((validate(tool), tool)),
      method_(method),
      time_step_(time_step),
      path_share_(path_share),
      corner_slices_(corner_slices),
      radius_offset_(radius_offset),
      law_(law) {
  addMills(0.0);
}

/// Straight mills up to a height [m] at least.
void Cutter::addMills(double height) {
  if (!mills_.empty() && mills_.back().slice.high >= height) return;
  const std::vector<EdgeSlice> slices = edgeSlices(tool_, height, corner_slices_);
  for (std::size_t s = mills_.size(); s < slices.size(); ++s) {
    StraightMill mill;
    mill.slice = mill.actual = slices[s];
    const ToolGeometry straight = toolOf(slices[s], tool_);
    const std::vector<double> radii = radiiOf(slices[s], tool_, radius_offset_);
    if (method_ == Method::tables) {
      mill.rigid.emplace(straight, lawOf(slices[s], law_), radii, path_share_);
    } else {
      mill.process.emplace(straight, lawOf(slices[s], law_), time_step_, radii, path_share_);
      mill.process->setLean(slices[s].lean());
    }
    mills_.push_back(std::move(mill));
  }
}

// The edge of a slice is the edge of a tip whose angle lags accordingly.
ToolMotion Cutter::motionOf(const StraightMill& mill, const ToolMotion& now) const {
  ToolMotion motion = now;
  motion.angle -= mill.slice.turn;
  return motion;
}

// Intersects the arcs with the height of a slice.
void Cutter::updateContact(StraightMill& mill) {
  std::vector<ContactArc> arcs;
  double bottom = mill.slice.high, top = mill.slice.low;
  for (const ContactArc& arc : arcs_) {
    const double low = std::max(arc.bottom, mill.slice.low), high = std::min(arc.depth, mill.slice.high);
    if (high <= low) continue;
    arcs.push_back({arc.entry, arc.exit, high - mill.slice.low, low - mill.slice.low});
    bottom = std::min(bottom, low);
    top = std::max(top, high);
  }
  if (mill.slice.curved && !arcs.empty() && (bottom != mill.actual.low || top != mill.actual.high)) {
    mill.actual = between(bottom, top, mill.slice, tool_);
    const CuttingLaw law = lawOf(mill.actual, law_);
    if (mill.process) mill.process->setLaw(law);
    if (mill.rigid) mill.rigid->setLaw(law);
  }
  if (arcs_changed_ || arcs.size() != mill.arcs) {
    if (mill.process) mill.process->engage(arcs, motionOf(mill, now_));
    if (mill.rigid) mill.rigid->engage(arcs, feedOf(now_));
    mill.arcs = arcs.size();
    return;
  }
  std::vector<double> depths;
  for (const ContactArc& arc : arcs) depths.push_back(arc.depth);
  if (mill.process) mill.process->setDepths(depths);
  if (mill.rigid) mill.rigid->setDepths(depths);
}

void Cutter::updateContacts() {
  double height = 0.0;
  for (const ContactArc& arc : arcs_) height = std::max(height, arc.depth);
  addMills(height);
  for (StraightMill& mill : mills_) updateContact(mill);
}

void Cutter::engage(const std::vector<ContactArc>& arcs, const ToolMotion& now) {
  arcs_ = arcs;
  now_ = now;
  arcs_changed_ = true;
  updateContacts();
  arcs_changed_ = false;
}

void Cutter::setDepths(const std::vector<ContactArc>& arcs) {
  arcs_ = arcs;
  updateContacts();
}

void Cutter::setLaw(const CuttingLaw& law) {
  law_ = law;
  for (StraightMill& mill : mills_) {
    const CuttingLaw adapted = lawOf(mill.actual, law);
    if (mill.process) mill.process->setLaw(adapted);
    if (mill.rigid) mill.rigid->setLaw(adapted);
  }
}

void Cutter::setRadii(const std::vector<double>& radius_offset) {
  if (method_ == Method::tables) throw Error("cutting: radii that change, expected none with tables");
  radius_offset_ = radius_offset;
  for (StraightMill& mill : mills_) mill.process->setRadii(radiiOf(mill.slice, tool_, radius_offset));
}

CutSums Cutter::sumsOf(StraightMill& mill, const ToolMotion& now) const {
  if (mill.process) return mill.process->sumsAt(mill.slice.turn == 0.0 ? now : motionOf(mill, now));
  CutSums sums;
  sums.edges = mill.rigid->sumsAt(now.angle - mill.slice.turn);
  return sums;
}

CuttingForce Cutter::force() const {
  CuttingForce sum;
  for (const StraightMill& mill : mills_) {
    if (mill.arcs == 0) continue;
    sum.add(mill.rigid ? mill.rigid->force(mill.sums.edges) : mill.process->force(mill.sums));
  }
  return sum;
}

// The force is linear in the rate and the rate in the force: a linear system of two equations.
void Cutter::solveRubbing(const ToolMotion& now, const TipMobility& mobility) {
  const auto forceAt = [&](const Eigen::Vector2d& rate) -> Eigen::Vector2d {
    for (StraightMill& mill : mills_) {
      if (mill.arcs > 0) mill.sums.rubbing = mill.process->rubbing({{rate[0], rate[1]}}, now.speed);
    }
    const CuttingForce f = force();
    return {f.fx, f.fy};
  };
  const Eigen::Vector2d assumed(mobility.assumed_force[0], mobility.assumed_force[1]),
      rate(now.rate[0], now.rate[1]);
  const Eigen::DiagonalMatrix<double, 2> rate_per_force(mobility.rate_per_force[0],
                                                        mobility.rate_per_force[1]);
  const Eigen::Vector2d force_at_rest = forceAt({0.0, 0.0});
  Eigen::Matrix2d force_slope;
  force_slope << forceAt({1.0, 0.0}) - force_at_rest, forceAt({0.0, 1.0}) - force_at_rest;
  const Eigen::Matrix2d system = Eigen::Matrix2d::Identity() - rate_per_force * force_slope;
  forceAt(system.inverse() * (rate + rate_per_force * (force_at_rest - assumed)));
}

CuttingForce Cutter::step(const ToolMotion& now, const TipMobility& mobility) {
  if (mills_.size() > 1) now_ = now;  // a change of depth may engage another slice
  for (StraightMill& mill : mills_) {
    if (mill.arcs == 0) continue;
    mill.sums = replayed_ ? replayed_->at(replay_index_++) : sumsOf(mill, now);
  }
  const bool is_mobile = mobility.rate_per_force[0] != 0.0 || mobility.rate_per_force[1] != 0.0;
  if (!replayed_ && is_mobile && law_.damping != 0.0) solveRubbing(now, mobility);
  for (const StraightMill& mill : mills_) {
    if (recorded_ && mill.arcs > 0) recorded_->push_back(mill.sums);
  }
  return force();
}

void Cutter::endStep(const std::array<double, 2>& displacement) {
  for (StraightMill& mill : mills_) {
    if (mill.process && !replayed_) mill.process->endStep(displacement);
  }
}

}  // namespace smartmill::sim
