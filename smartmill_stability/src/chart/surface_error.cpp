#include "smartmill_stability/chart/surface_error.h"

#include <algorithm>
#include <cmath>
#include <complex>
#include <limits>
#include <random>

#include "smartmill_core/cutting/chip_rule.h"
#include "smartmill_core/error.h"
#include "smartmill_core/formatted.h"
#include "smartmill_core/signal/statistics.h"
#include "smartmill_stability/chart/risk.h"
#include "solvers/floquet.h"
#include "solvers/forced_vibration.h"

namespace smartmill::stability {
namespace {

using Complex = std::complex<double>;
using units::PI;
using units::TWO_PI;

struct WallResolution {
  double same_angle = 1e-6;   ///< [rad] within which an arc begins at 0 or ends at pi
  double height_step = 0.05;  ///< [rad] lag of the edge from height to height; the vibration of one is smooth
  int most_heights = 80;      ///< limits the time
  int profile = 480;          ///< points of the wall's profile over a revolution
  double band = 20.0;         ///< [1] highest frequency of the series over the highest natural frequency
  int least_harmonics = 40;   ///< of the tooth passing frequency
};
constexpr WallResolution WALL;

/// [rad] Integral of exp(-i m phi) over the arc.
Complex arcIntegral(int m, double entry, double exit) {
  if (m == 0) return exit - entry;
  const Complex i(0.0, 1.0);
  return (std::polar(1.0, -m * entry) - std::polar(1.0, -m * exit)) / (i * static_cast<double>(m));
}

/// [N/m] Fourier coefficient n of the force on the tool of one tooth and a metre of its edge, chip thickness
/// feed sin(phi): Fx = -Ft cos - Fr sin, Fy = Ft sin - Fr cos.
std::array<Complex, 2> toothForce(const RegenerativeSystem& s, int n) {
  const ChipGeometry& chip = *s.chip;
  const auto e = [&](int m) { return arcIntegral(m, s.entry, s.exit); };
  const Complex i(0.0, 1.0), one = e(n);
  const Complex cos1 = 0.5 * (e(n - 1) + e(n + 1)), sin1 = (e(n - 1) - e(n + 1)) / (2.0 * i);
  const Complex cos2 = 0.5 * (e(n - 2) + e(n + 2)), sin2 = (e(n - 2) - e(n + 2)) / (2.0 * i);
  const double t = 0.5 * s.kt * chip.feed, r = 0.5 * s.kr * chip.feed;
  return {{(-t * sin2 - r * (one - cos2) - chip.kte * cos1 - chip.kre * sin1) / TWO_PI,
           (t * (one - cos2) - r * sin2 + chip.kte * sin1 - chip.kre * cos1) / TWO_PI}};
}

/// [m] Integral of exp(-i n lag z) over the depth.
Complex edgeIntegral(int n, double lag, double depth) {
  const double turn = n * lag * depth;
  if (std::abs(turn) < 1e-9) return depth;
  const Complex i(0.0, 1.0);
  return depth * (1.0 - std::polar(1.0, -turn)) / (i * turn);
}

/// Mean, peak to valley and mean deviation of a periodic profile.
struct ProfileFigures {
  double mean = 0.0, peak_to_valley = 0.0, mean_deviation = 0.0;
};

/// Profile along the feed of passes that leave parabolas: the deepest of them at each point.
/// @param at [m] position of each pass within a period @param depth [m] of each @param radius [m] of
/// curvature
ProfileFigures profileOf(const std::vector<double>& at, const std::vector<double>& depth, double period,
                         double radius) {
  std::vector<double> profile;
  for (int j = 0; j < WALL.profile; ++j) {
    const double x = period * (j + 0.5) / WALL.profile;
    double deepest = -std::numeric_limits<double>::infinity();
    for (std::size_t k = 0; k < at.size(); ++k) {
      const double off = std::remainder(x - at[k], period);
      deepest = std::max(deepest, depth[k] - off * off / (2.0 * radius));
    }
    profile.push_back(deepest);
  }
  ProfileFigures figures;
  for (const double p : profile) figures.mean += p / WALL.profile;
  for (const double p : profile) figures.mean_deviation += std::abs(p - figures.mean) / WALL.profile;
  const auto [low, high] = std::minmax_element(profile.begin(), profile.end());
  figures.peak_to_valley = *high - *low;
  return figures;
}

}  // namespace

ChipGeometry finishingChip(const MachineModel& model, double feed) {
  const CuttingCoefficients& cutting = model.needCutting("predict the surface location error");
  ChipGeometry chip;
  chip.feed = feed;
  chip.kte = cutting.kte;
  chip.kre = cutting.kre;
  for (const EffectEntry& effect : model.effects) {
    if (effect.name != "runout") continue;
    const ToolGeometry& tool = model.needTool("predict the surface location error");
    const std::vector<double> radii = runoutRadii(tool, effect.numbers.at("offset_um") * units::UM,
                                                  units::radFromDeg(effect.numbers.at("angle_deg")));
    chip.radius_offset.resize(radii.size(), 0.0);
    for (std::size_t k = 0; k < radii.size(); ++k) chip.radius_offset[k] += radii[k];
  }
  return chip;
}

bool requireOneWall(double entry, double exit) {
  const bool up = std::abs(entry) < WALL.same_angle, down = std::abs(exit - PI) < WALL.same_angle;
  if (up == down)
    throw Error(
        formatted("surface error: entry %.2f deg, exit %.2f deg: expected one wall, by up-milling (entry "
                  "0, exit below 180 deg) or down-milling (entry above 0, exit 180 deg)",
                  units::degFromRad(entry), units::degFromRad(exit)));
  return down;
}

WallPrediction::WallPrediction(const RegenerativeSystem& system) : system_(system) {
  system_.validate();
  if (system_.cut != Cut::milling || !system_.chip || system_.modes.empty())
    throw Error("surface error: expected milling with modes and a chip geometry");
  if (!(system_.diameter > 0.0)) throw Error("surface error: expected a tool diameter above 0");
  requireStraightEdge(system_.tool(), "for the surface location error");
  down_ = requireOneWall(system_.entry, system_.exit);
  const ToolGeometry tool = system_.tool();
  lag_ = system_.helix > 0.0 ? tool.lag() : 0.0;
  const ChipRule rule(tool, system_.chip->radius_offset);
  alike_ = rule.alike();
  tooth_angle_ = rule.toothAngle();
}

std::vector<double> WallPrediction::heightsOf(double depth) const {
  const int steps = std::min(WALL.most_heights, static_cast<int>(std::ceil(lag_ * depth / WALL.height_step)));
  std::vector<double> heights{0.0};
  for (int i = 1; i <= steps; ++i) heights.push_back(depth * i / steps);
  return heights;
}

/// The harmonics of the tooth passing frequency (Schmitz and Smith's frequency-domain solution).
std::vector<double> WallPrediction::alikeOffsets(double speed, double depth,
                                                 const std::vector<double>& heights) const {
  double highest = 0.0;
  for (const SystemMode& mode : system_.modes) highest = std::max(highest, mode.frequency);
  const int teeth = system_.teeth;
  const int most = std::max(WALL.least_harmonics,
                            static_cast<int>(std::ceil(WALL.band * TWO_PI * highest / (teeth * speed))));
  const double wall = down_ ? PI : 0.0;
  std::vector<double> offsets(heights.size(), 0.0);
  for (int j = 0; j <= most; ++j) {
    const int n = j * teeth;
    const std::array<Complex, 2> tooth = toothForce(system_, n);
    const auto g = receptance(system_.modes, n * speed / TWO_PI);
    const Complex y = (j == 0 ? 1.0 : 2.0) * static_cast<double>(teeth) * edgeIntegral(n, lag_, depth) *
                      (g[2] * tooth[0] + g[3] * tooth[1]);
    for (std::size_t h = 0; h < heights.size(); ++h)
      offsets[h] += (y * std::polar(1.0, n * (wall + lag_ * heights[h]))).real();
  }
  if (down_)
    for (double& offset : offsets) offset = -offset;
  return offsets;
}

std::vector<std::vector<double>> WallPrediction::offsets(double speed, double depth,
                                                         const std::vector<double>& heights) const {
  if (!(speed > 0.0) || !(depth > 0.0)) throw Error("surface error: expected speed and depth above 0");
  const auto ownRadius = [this](std::size_t k) {
    return system_.chip->radius_offset.empty() ? 0.0 : system_.chip->radius_offset[k];
  };
  if (alike_) {
    std::vector<double> offsets = alikeOffsets(speed, depth, heights);
    for (double& offset : offsets) offset += ownRadius(0);
    return {offsets};
  }
  const ForcedVibration vibration = forcedVibration(system_, speed, depth);
  std::vector<std::vector<double>> offsets;
  for (std::size_t k = 0; k < tooth_angle_.size(); ++k) {
    const double own = ownRadius(k);
    offsets.emplace_back();
    for (const double height : heights) {
      const double turned = (down_ ? PI : 0.0) - tooth_angle_[k] + lag_ * height;
      offsets.back().push_back(own + (down_ ? -1.0 : 1.0) * vibration.at(turned)[1]);
    }
  }
  return offsets;
}

MachinedWall WallPrediction::at(double speed, double depth) const {
  const std::vector<double> heights = heightsOf(depth);
  const std::vector<std::vector<double>> passes = offsets(speed, depth, heights);
  const double feed = system_.chip->feed, turn = feed * system_.teeth;  // [m] of a tooth, of a revolution
  // Curvature of the path of a tooth past the wall: the feed adds to its speed when up-milling (Martellotti).
  const double radius = 0.5 * system_.diameter;
  const double stretch = 1.0 + (down_ ? -1.0 : 1.0) * turn / (TWO_PI * radius);
  const double curvature = radius * stretch * stretch;
  const double period = alike_ ? feed : turn;
  std::vector<double> at;  // [m] of the passes along the feed: a tooth that is ahead passes earlier
  for (std::size_t k = 0; k < passes.size(); ++k) at.push_back(-turn * tooth_angle_[k] / TWO_PI);
  const double rigid = -feed * feed / (24.0 * curvature);  // [m] mean line of the marks of alike teeth
  MachinedWall wall;
  for (std::size_t h = 0; h < heights.size(); ++h) {
    std::vector<double> depths;
    for (const auto& pass : passes) depths.push_back(pass[h]);
    // Alike teeth leave the same marks at all heights.
    if (!alike_ || h == 0) {
      const ProfileFigures figures = profileOf(at, depths, period, curvature);
      wall.peak_to_valley = std::max(wall.peak_to_valley, figures.peak_to_valley);
      wall.mean_deviation = std::max(wall.mean_deviation, figures.mean_deviation);
      if (!alike_) depths.front() = figures.mean - rigid;
    }
    wall.least = h == 0 ? depths.front() : std::min(wall.least, depths.front());
    wall.most = h == 0 ? depths.front() : std::max(wall.most, depths.front());
  }
  wall.error = std::abs(wall.least) > std::abs(wall.most) ? wall.least : wall.most;
  return wall;
}

double errorStd(const std::vector<WallPrediction>& drawn, double speed, double depth) {
  std::vector<double> least, most;
  for (const WallPrediction& machine : drawn) {
    const MachinedWall wall = machine.at(speed, depth);
    least.push_back(wall.least);
    most.push_back(wall.most);
  }
  return std::max(standardDeviation(least), standardDeviation(most));
}

SurfaceMap surfaceMap(const UncertainSystem& system, const std::vector<double>& speeds,
                      const std::vector<double>& depths, const SurfaceMapOptions& options,
                      const std::function<void(double)>& progress) {
  if (speeds.empty() || depths.empty()) throw Error("surface map: expected at least one speed and one depth");
  if (options.draws < 2)
    throw Error("surface map: draws: " + std::to_string(options.draws) + ": expected at least 2");
  SurfaceMap map;
  map.speeds = speeds;
  map.depths = depths;
  const WallPrediction mean(system.mean());
  RegenerativeSystem alike = system.mean();
  alike.chip->radius_offset.clear();
  alike.pitch.clear();
  std::vector<WallPrediction> drawn;
  const UncertainSystem about = system.about(alike);
  std::mt19937_64 random(options.seed);
  for (int i = 0; i < options.draws; ++i) drawn.emplace_back(about.draw(random));

  RegenerativeSystem cut = system.mean();
  if (mean.alike()) cut.chip.reset();  // the contact is known
  SolverOptions solver = SolverOptions::ofManyPoints();
  for (const Limit& limit : makeSolver(Method::collocation, cut, solver)->limits(speeds, depths.back()))
    map.limit.push_back(limit.depth);
  const std::vector<double> share = depthsAtRisk(drawnLimits(system, speeds, options.draws, options.seed),
                                                 speeds, options.risk, options.speed_margin);
  for (std::size_t s = 0; s < speeds.size(); ++s) {
    map.at_risk.push_back(share[s] * map.limit[s]);
    map.wall.emplace_back();
    map.error_std.emplace_back();
    for (const double depth : depths) {
      map.wall.back().push_back(mean.at(speeds[s], depth));
      map.error_std.back().push_back(errorStd(drawn, speeds[s], depth));
    }
    if (progress) progress((s + 1.0) / static_cast<double>(speeds.size()));
  }
  return map;
}

std::vector<FinishingCut> finishingCuts(const SurfaceMap& map, double tolerance, double speed_margin,
                                        double depth_margin, int count) {
  if (!(tolerance > 0.0)) throw Error("tolerance: expected a value above 0");
  std::vector<FinishingCut> cuts;
  for (std::size_t s = 0; s < map.speeds.size(); ++s) {
    // Beyond the map the wall is unknown.
    if (map.speeds[s] * (1.0 - speed_margin) < map.speeds.front() ||
        map.speeds[s] * (1.0 + speed_margin) > map.speeds.back())
      continue;
    // Speeds within the margin and the next ones of the grid.
    std::size_t from = s, to = s;
    while (from > 0 && map.speeds[from] > map.speeds[s] * (1.0 - speed_margin)) --from;
    while (to + 1 < map.speeds.size() && map.speeds[to] < map.speeds[s] * (1.0 + speed_margin)) ++to;
    double permitted = std::numeric_limits<double>::infinity();
    for (std::size_t k = from; k <= to; ++k)
      permitted = std::min(permitted, (1.0 - depth_margin) * map.limit[k]);
    permitted = std::min(permitted, map.at_risk[s]);
    for (std::size_t d = map.depths.size(); d-- > 0;) {
      if (map.depths[d] > permitted) continue;
      double worst = 0.0;
      for (std::size_t k = from; k <= to; ++k)
        worst = std::max(worst, std::abs(map.wall[k][d].error) + 2.0 * map.error_std[k][d]);
      if (worst > tolerance) continue;
      cuts.push_back({map.speeds[s], map.depths[d], map.wall[s][d], map.error_std[s][d], worst});
      break;
    }
  }
  std::stable_sort(cuts.begin(), cuts.end(), [](const FinishingCut& a, const FinishingCut& b) {
    return a.speed * a.depth > b.speed * b.depth;
  });
  constexpr double POCKET = 0.05;
  std::vector<FinishingCut> chosen;
  for (const FinishingCut& cut : cuts) {
    if (static_cast<int>(chosen.size()) >= count) break;
    if (std::none_of(chosen.begin(), chosen.end(),
                     [&](const FinishingCut& c) { return std::abs(cut.speed / c.speed - 1.0) < POCKET; }))
      chosen.push_back(cut);
  }
  return chosen;
}

}  // namespace smartmill::stability
