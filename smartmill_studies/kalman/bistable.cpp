#include "kalman/bistable.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "smartmill_core/io/gnuplot.h"
#include "smartmill_core/units.h"

namespace smartmill::kalman {
namespace {

constexpr int PERIODS = 250;     // tooth periods per run
constexpr int LOOKED = 30;       // evaluated periods at the end and in the middle
constexpr double DYING = 0.8;    // [1] ratio of the final to the middle vibration, below which it decays
constexpr int LEAST_STEPS = 40;  // per period of the mode
constexpr double SMALL = 1e-3;   // [1] of the feed
constexpr double STAYS = 0.05;   // [1] of the feed, from which a large vibration persists
constexpr double CLOSE = 1e-3;   // [1] relative tolerance of the depth

/// Peak to peak in the middle and in the last periods [m].
struct Vibration {
  double middle = 0.0, last = 0.0;
};

/// The tool starts at its deflection under the steady chip plus `kick` [m].
Vibration vibration(const ForceCurve& law, const Mode& mode, double period, double feed, double depth,
                    double kick) {
  const double w = units::TWO_PI * mode.frequency;
  const int steps = std::max(LEAST_STEPS, static_cast<int>(std::ceil(LEAST_STEPS * mode.frequency * period)));
  const double dt = period / steps, rest = mode.gain * depth * law.at(feed);
  // The surface one period earlier, in the frame of the commanded path.
  std::vector<double> surface(static_cast<std::size_t>(steps), feed + rest);
  double x = rest + kick, v = 0.0;
  std::array<double, 2> low{1e9, 1e9}, high{-1e9, -1e9};
  for (int n = 0; n < PERIODS * steps; ++n) {
    double& left = surface[static_cast<std::size_t>(n % steps)];
    const double chip = std::max(0.0, left - x);
    const double force = chip > 0.0 ? depth * law.at(chip) : 0.0;
    v += dt * (w * w * (mode.gain * force - x) - 2.0 * mode.damping_ratio * w * v);  // semi-implicit Euler
    x += dt * v;
    left = std::min(left, x) + feed;
    const int period_now = n / steps % (PERIODS / 2);
    if (period_now < PERIODS / 2 - LOOKED) continue;
    const std::size_t half = n / steps < PERIODS / 2 ? 0 : 1;
    low[half] = std::min(low[half], x);
    high[half] = std::max(high[half], x);
  }
  return {high[0] - low[0], high[1] - low[1]};
}

/// Least depth at which the vibration persists.
template <class Vibrates>
double limit(double deepest, Vibrates vibrates) {
  double stable = 0.0, chatter = deepest;
  if (!vibrates(deepest)) return deepest;
  while (chatter - stable > CLOSE * chatter) {
    const double middle = 0.5 * (stable + chatter);
    (vibrates(middle) ? chatter : stable) = middle;
  }
  return chatter;
}

}  // namespace

std::vector<BistablePoint> bistableRange(const ForceCurve& law, const Mode& mode, int teeth, double feed,
                                         const std::vector<double>& speeds, double kick, double deepest) {
  std::vector<BistablePoint> points;
  for (const double speed : speeds) {
    const double period = units::TWO_PI / speed / teeth;
    BistablePoint point;
    point.speed = speed;
    point.small = limit(deepest, [&](double depth) {
      const Vibration found = vibration(law, mode, period, feed, depth, SMALL * feed);
      return found.last > found.middle || found.last > STAYS * feed;
    });
    point.large = limit(point.small, [&](double depth) {
      const Vibration found = vibration(law, mode, period, feed, depth, kick * feed);
      return found.last > STAYS * feed && found.last > DYING * found.middle;
    });
    points.push_back(point);
  }
  return points;
}

void drawBistable(const std::vector<BistablePoint>& points, const std::string& png) {
  Gnuplot script(png, 900, 500, 11);
  script << "$d << EOD\n";
  for (const BistablePoint& p : points)
    script << units::rpmFromRadPerSec(p.speed) << " " << 1e3 * p.small << " " << 1e3 * p.large << "\n";
  script << "EOD\nset xlabel 'spindle speed [rpm]'\nset ylabel 'depth of cut [mm]'\nset key top left\n"
            "plot $d using 1:2:3 with filledcurves lc 'gold' t 'both states', $d using 1:2 with lines lw 2 "
            "lc 'black' "
            "t 'the smallest vibration grows', $d using 1:3 with lines lw 2 lc 'red' t 'a large vibration "
            "stays'\n";
  script.draw();
}

}  // namespace smartmill::kalman
