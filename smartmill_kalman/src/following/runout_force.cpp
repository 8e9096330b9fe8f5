#include "smartmill_kalman/following/runout_force.h"

#include <algorithm>
#include <cmath>

#include "smartmill_core/cutting/mechanistic.h"
#include "smartmill_core/error.h"
#include "smartmill_core/units.h"

namespace smartmill::kalman {
namespace {

constexpr std::size_t TABLE = 16384;

}  // namespace

std::array<std::vector<double>, 2> revolutionForce(const ToolGeometry& tool, const CuttingCoefficients& k,
                                                   const Engagement& engagement,
                                                   const std::vector<double>& radius, std::size_t points) {
  validate(tool);
  validate(engagement);
  if (radius.size() != static_cast<std::size_t>(tool.teeth)) throw Error("one radius a tooth is due");
  // Force of one tooth's tip a unit of depth over its immersion angle, then its integral over the lag.
  const double step = units::TWO_PI / static_cast<double>(points);
  const double lag = tool.lag() * engagement.axial_depth;
  std::array<std::vector<double>, 2> force;
  for (auto& axis : force) axis.assign(points, 0.0);
  std::array<std::vector<double>, 2> integral;  // over two revolutions
  for (auto& axis : integral) axis.assign(2 * points + 1, 0.0);
  struct Tip {
    double h;
    std::array<double, 2> force, edge;  // at this chip, and were it about to vanish
  };
  for (int tooth = 0; tooth < tool.teeth; ++tooth) {
    Tip last{};
    for (std::size_t i = 0; i <= 2 * points; ++i) {
      const double phi = static_cast<double>(i % points) * step;
      const double sine = std::sin(phi), cosine = std::cos(phi);
      Tip tip{1e9, {}, {}};
      for (int j = 1; j <= tool.teeth; ++j) {
        tip.h =
            std::min(tip.h, j * engagement.feed_per_tooth * sine + radius[static_cast<std::size_t>(tooth)] -
                                radius[static_cast<std::size_t>((tooth + j) % tool.teeth)]);
      }
      const auto direct = [&](double ft, double fr) {
        return std::array<double, 2>{-ft * cosine - fr * sine, ft * sine - fr * cosine};
      };
      tip.edge = direct(k.kte, k.kre);
      tip.force = direct(k.ktc * tip.h + k.kte, k.krc * tip.h + k.kre);
      if (i > 0) {
        // Share of the interval inside the engagement, and the part of it where there is a chip: the force
        // must move smoothly with the radii.
        const double begin = static_cast<double>((i - 1) % points) * step;
        const double inside = std::clamp(
            (std::min(begin + step, engagement.exit) - std::max(begin, engagement.entry)) / step, 0.0, 1.0);
        for (std::size_t axis = 0; axis < 2; ++axis) {
          double sum = 0.0;
          if (last.h > 0.0 && tip.h > 0.0) {
            sum = last.force[axis] + tip.force[axis];
          } else if (last.h > 0.0) {
            sum = last.h / (last.h - tip.h) * (last.force[axis] + last.edge[axis]);
          } else if (tip.h > 0.0) {
            sum = tip.h / (tip.h - last.h) * (tip.force[axis] + tip.edge[axis]);
          }
          integral[axis][i] = integral[axis][i - 1] + 0.5 * step * inside * sum;
        }
      }
      last = tip;
    }
    const double shift = tool.toothAngle(tooth) / step, wide = std::max(lag / step, 1.0);
    const double depth = engagement.axial_depth / (wide * step);
    for (std::size_t axis = 0; axis < 2; ++axis) {
      const auto read = [&](double x) {
        const auto n = std::min(static_cast<std::size_t>(x), 2 * points - 1);
        return integral[axis][n] + (x - static_cast<double>(n)) * (integral[axis][n + 1] - integral[axis][n]);
      };
      for (std::size_t i = 0; i < points; ++i) {
        const double at = std::fmod(static_cast<double>(i) + shift, static_cast<double>(points)) +
                          static_cast<double>(points);
        force[axis][i] += depth * (read(at) - read(at - wide));
      }
    }
  }
  return force;
}

RunoutForce::RunoutForce(const ToolGeometry& tool, const CuttingCoefficients& k, const Engagement& engagement,
                         double runout, double runout_angle) {
  validate(tool);
  std::vector<double> radius;
  for (int tooth = 0; tooth < tool.teeth; ++tooth)
    radius.push_back(runout * std::cos(tool.toothAngle(tooth) - runout_angle));
  table_ = revolutionForce(tool, k, engagement, radius, TABLE);
  for (auto& axis : table_) axis.push_back(axis.front());
}

std::array<double, 2> RunoutForce::at(double spindle_angle) const {
  double at = std::fmod(spindle_angle, units::TWO_PI) / units::TWO_PI * TABLE;
  if (at < 0.0) at += TABLE;
  const auto n = std::min(static_cast<std::size_t>(at), TABLE - 1);
  const double rest = at - static_cast<double>(n);
  return {table_[0][n] + rest * (table_[0][n + 1] - table_[0][n]),
          table_[1][n] + rest * (table_[1][n + 1] - table_[1][n])};
}

}  // namespace smartmill::kalman
