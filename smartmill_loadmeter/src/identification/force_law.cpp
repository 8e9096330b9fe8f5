#include "smartmill_loadmeter/identification/force_law.h"

#include <algorithm>
#include <cmath>

#include "smartmill_core/error.h"
#include "smartmill_core/math/angle.h"
#include "smartmill_core/units.h"
#include "smartmill_loadmeter/calibration/fit.h"

namespace smartmill::loadmeter {

using units::TWO_PI;

std::vector<ForcePoint> forcePoints(const std::vector<double>& fx, const std::vector<double>& fy,
                                    const std::vector<double>& spindle_angle, const ToolGeometry& tool,
                                    const Engagement& engagement) {
  requireStraightEdge(tool, "to compute the force of a chip thickness");
  const double spread = tool.lag() * engagement.axial_depth;  // [rad] of an edge
  std::vector<ForcePoint> points;
  for (std::size_t i = 0; i < fx.size(); ++i) {
    int in_cut = 0, whole = 0;
    double phi = 0.0;
    for (int t = 0; t < tool.teeth; ++t) {
      const double tip = wrapped(spindle_angle[i] + tool.toothAngle(t));
      // The edge extends from the tip back by the spread.
      const bool touches = (tip > engagement.entry && tip - spread < engagement.exit) ||
                           (tip + TWO_PI > engagement.entry && tip + TWO_PI - spread < engagement.exit);
      if (!touches) continue;
      ++in_cut;
      if (tip - spread >= engagement.entry && tip <= engagement.exit) {
        ++whole;
        phi = tip - 0.5 * spread;
      }
    }
    if (in_cut != 1 || whole != 1) continue;
    const double s = std::sin(phi), c = std::cos(phi);
    // Inverse of Fx = -Ft c - Fr s, Fy = Ft s - Fr c.
    ForcePoint p;
    p.chip = engagement.feed_per_tooth * s;
    p.tangential = (-fx[i] * c + fy[i] * s) / engagement.axial_depth;
    p.radial = (-fx[i] * s - fy[i] * c) / engagement.axial_depth;
    points.push_back(p);
  }
  if (points.empty()) {
    throw Error(
        "force against chip thickness: expected angles with one tooth in cut over its whole depth, found "
        "none");
  }
  return points;
}

const char* nameOf(ForceLawKind kind) {
  return kind == ForceLawKind::linear           ? "linear"
         : kind == ForceLawKind::shifted_linear ? "shifted linear"
                                                : "power";
}

double ForceLaw::at(double chip) const {
  if (kind == ForceLawKind::power) return value[0] * std::pow(std::max(chip, 0.0) / REFERENCE_CHIP, value[1]);
  const double line = value[0] * chip + value[1];
  if (kind == ForceLawKind::linear || chip >= value[2]) return line;
  return chip / value[2] * (value[0] * value[2] + value[1]);
}

std::vector<ForceLaw> fitForceLaws(const std::vector<double>& chip, const std::vector<double>& force) {
  const std::size_t n = chip.size();
  if (n < 10) throw Error("force law: " + std::to_string(n) + " points, expected 10 or more");
  double sx = 0.0, sy = 0.0, sxx = 0.0, sxy = 0.0;
  for (std::size_t i = 0; i < n; ++i) {
    sx += chip[i], sy += force[i], sxx += chip[i] * chip[i], sxy += chip[i] * force[i];
  }
  const double count = static_cast<double>(n), determinant = count * sxx - sx * sx;
  if (!(determinant > 1e-12 * count * sxx)) throw Error("force law: all points have the same chip thickness");
  const double slope = (count * sxy - sx * sy) / determinant, level = (sy - slope * sx) / count;
  const auto [low, high] = std::minmax_element(chip.begin(), chip.end());
  const double size = std::max(std::abs(slope) * *high, std::abs(level)) + 1e-9;
  std::vector<ForceLaw> laws;
  for (const ForceLawKind kind : {ForceLawKind::linear, ForceLawKind::shifted_linear, ForceLawKind::power}) {
    ForceLaw law;
    law.kind = kind;
    std::vector<FitParameter> start;
    const double wide = 100.0 * size;
    if (kind == ForceLawKind::power) {
      start = {{slope * ForceLaw::REFERENCE_CHIP + level, -wide, wide, size}, {0.7, -0.5, 3.0, 0.3}};
    } else {
      start = {{slope, -wide / *high, wide / *high, size / *high}, {level, -wide, wide, size}};
      if (kind == ForceLawKind::shifted_linear) {
        start.push_back({0.3 * *high, std::max(*low, 1e-3 * *high), *high, 0.3 * *high});
      }
    }
    const auto residuals = [&](const std::vector<double>& v, double* out) {
      ForceLaw l = law;
      std::copy(v.begin(), v.end(), l.value.begin());
      for (std::size_t i = 0; i < n; ++i) *out++ = (l.at(chip[i]) - force[i]) / size;
    };
    FitResult best;
    for (const double knee : {0.1, 0.3, 0.6}) {
      if (kind == ForceLawKind::shifted_linear) start[2].start = knee * *high;
      const FitResult candidate = fitLeastSquares(residuals, n, start);
      if (best.value.empty() || candidate.squares < best.squares) best = candidate;
      if (kind != ForceLawKind::shifted_linear) break;
    }
    std::copy(best.value.begin(), best.value.end(), law.value.begin());
    const double variance = best.squares / (count - static_cast<double>(start.size()));
    for (std::size_t i = 0; i < start.size(); ++i)
      law.std_dev[i] = std::sqrt(variance * best.covarianceOf(i, i));
    law.bic = bayesianInformationCriterion(best.squares, n, start.size(), false);
    law.rms = size * std::sqrt(best.squares / count);
    laws.push_back(law);
  }
  std::stable_sort(laws.begin(), laws.end(),
                   [](const ForceLaw& a, const ForceLaw& b) { return a.bic < b.bic; });
  return laws;
}

}  // namespace smartmill::loadmeter
