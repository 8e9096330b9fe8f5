#pragma once

#include <vector>

#include "smartmill_program/engagement/contact.h"

namespace smartmill::program {

constexpr double LEVEL = 1e-9;  // [1] horizontal share of a feed along the tool axis, despite rounding

/// The material around a tool, by immersion angle and height.
class Surroundings {
 public:
  Surroundings(const Stock& stock, const ToolPlace& place);

  double share() const { return share_; }  ///< [1] horizontal part of the feed
  double rise() const { return rise_; }    ///< [1] part of it along the tool axis, upwards
  double tip() const { return tip_[2]; }   ///< [m]
  const Stock& stock() const { return stock_; }

  /// [m] Material above a height over the tip (not below the stock) at a distance from the axis.
  double above(double phi, double distance, double height) const;

 private:
  const Stock& stock_;
  std::array<double, 3> tip_;
  double share_, rise_;
  std::array<double, 2> x_{{1.0, 0.0}}, y_{};  // unit axes of the feed frame
};

/// Arcs of a cylinder: the material above its lower end, over the angle.
/// @param bottom [m] of the cylinder above the tip
std::vector<EngagedArc> cylinderArcs(const Surroundings& around, double radius, double bottom);

bool sameAngles(const EngagedArc& a, const EngagedArc& b);

/// Adds the contact of the curved or inclined part of an edge, and the volume that it removes.
void addCurvedContact(const Surroundings& around, const ToolProfile& profile, Contact& contact);

}  // namespace smartmill::program
