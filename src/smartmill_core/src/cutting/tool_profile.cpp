#include "smartmill_core/cutting/tool_profile.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "smartmill_core/cutting/corner.h"
#include "smartmill_core/cutting/mechanistic.h"
#include "smartmill_core/units.h"

namespace smartmill {

ToolProfile::ToolProfile(double radius) : radius_(radius), flat_radius_(radius) {
}

ToolProfile::ToolProfile(const ToolGeometry& tool, double height) : ToolProfile(tool.radius()) {
  validate(tool.edge, tool);
  const double angle = tool.edge.edge_angle;
  if (!tool.edge.inclined()) return;
  corner_radius_ = tool.edge.corner_radius;
  corner_height_ = top_ = cornerHeight(tool);
  constexpr double ROUNDING = 1e-12;  // [m]
  const double flat = tool.radius() - corner_radius_ * std::tan(0.5 * angle);
  flat_radius_ = flat > ROUNDING ? flat : 0.0;
  corner_end_ = flat_radius_ + corner_radius_ * std::sin(angle);
  radius_ = corner_end_;
  if (angle == 0.5 * units::PI) return;
  tangent_ = std::tan(angle);
  top_ = std::max(height, corner_height_);
  radius_ = corner_end_ + (top_ - corner_height_) / tangent_;
}

double ToolProfile::height(double distance) const {
  const double beyond = distance - flat_radius_;
  if (beyond <= 0.0) return 0.0;
  if (distance > corner_end_ && tangent_ > 0.0) return corner_height_ + (distance - corner_end_) * tangent_;
  const double square = corner_radius_ * corner_radius_ - beyond * beyond;
  return corner_radius_ - std::sqrt(std::max(0.0, square));
}

double ToolProfile::slope(double distance) const {
  const double beyond = distance - flat_radius_;
  if (beyond <= 0.0) return 0.0;
  if (distance > corner_end_ && tangent_ > 0.0) return tangent_;
  const double square = corner_radius_ * corner_radius_ - beyond * beyond;
  return square > 0.0 ? beyond / std::sqrt(square) : std::numeric_limits<double>::infinity();
}

double ToolProfile::radiusAt(double height) const {
  if (height >= top_) return radius_;
  if (height > corner_height_) return corner_end_ + (height - corner_height_) / tangent_;
  const double below = corner_radius_ - std::max(0.0, height);
  return flat_radius_ + std::sqrt(std::max(0.0, corner_radius_ * corner_radius_ - below * below));
}

}  // namespace smartmill
