#include "program/corner_pocket.h"

#include <algorithm>
#include <cmath>

#include "smartmill_core/error.h"
#include "smartmill_core/formatted.h"
#include "smartmill_core/units.h"
#include "smartmill_program/prediction/stability_limits.h"

namespace smartmill {
namespace {

using units::MM;
using units::PI;

constexpr int MOST_TRIES = 10000;
constexpr double LINE_MARGIN = 1.25, LEAST_DEPTH = 0.8 * MM, MOST_CORNER_DEPTH = 6.0 * MM;

/// Arc of contact of the corner: the wall before is about the same centre.
double entryOnArc(const CornerPocket& pocket, double tool_radius) {
  const double r = pocket.radius, wall = r - pocket.step + tool_radius;
  return std::acos(
      std::max(-1.0, (tool_radius * tool_radius + r * r - wall * wall) / (2.0 * tool_radius * r)));
}

/// [m] Way of the tool on the arc until its entry comes to the line after it.
double constantWay(const CornerPocket& pocket, double tool_radius) {
  const double entry = entryOnArc(pocket, tool_radius);
  const double ahead =
      std::atan2(tool_radius * std::sin(entry), pocket.radius - tool_radius * std::cos(entry));
  return (0.5 * PI - ahead) * pocket.radius;
}

struct Draw {
  std::mt19937_64& random;
  double operator()(double low, double high) const {
    return std::uniform_real_distribution<double>(low, high)(random);
  }
};

MachineModel drawMachine(const MachineModel& base, const Draw& uniform) {
  MachineModel machine = base;
  ToolGeometry tool;
  tool.teeth = uniform(0.0, 1.0) < 0.5 ? 2 : 3;
  tool.diameter = uniform(12.0, 20.0) * MM;
  tool.helix = units::radFromDeg(30.0);
  machine.tool = tool;
  CuttingCoefficients& k = *machine.cutting;
  k.ktc = uniform(600.0, 1200.0) * units::N_PER_MM2;
  k.krc = uniform(0.2, 0.4) * k.ktc;
  k.kte = uniform(12.0, 30.0) * units::N_PER_MM;
  k.kre = uniform(0.8, 1.2) * k.kte;
  for (ModalModel* axis : {&machine.tool_tip.x, &machine.tool_tip.y}) {
    axis->modes.resize(1);
    axis->modes[0].frequency = uniform(600.0, 1500.0);
    axis->modes[0].damping_ratio = uniform(0.02, 0.05);
    axis->modes[0].gain = 1.0 / (uniform(6.0, 20.0) / units::UM);
  }
  machine.workpiece->low = {-0.5 * CornerPocket::SIDE, -0.5 * CornerPocket::SIDE, -0.2};
  machine.workpiece->high = {0.5 * CornerPocket::SIDE, 0.5 * CornerPocket::SIDE, -0.16};
  machine.hammer.reset();
  return machine;
}

/// [m] Least limit of a contact while the feed turns from x by an angle [rad].
double limitOf(program::StabilityLimits& limits, double entry, double speed, double turn = 0.5 * PI) {
  constexpr int DIRECTIONS = 6;
  double least = 1e9;
  for (int k = 0; k <= DIRECTIONS; ++k)
    least = std::min(least, limits.limit({{{entry, PI, 1.0 * MM}}}, turn * k / DIRECTIONS, false, speed));
  return least;
}

}  // namespace

CornerCase drawCornerCase(const MachineModel& base, std::mt19937_64& random, const CornerRanges& ranges) {
  const Draw uniform{random};
  for (int attempt = 0; attempt < MOST_TRIES; ++attempt) {
    CornerCase drawn{drawMachine(base, uniform), {}};
    CornerPocket& pocket = drawn.pocket;
    const double radius = drawn.machine.tool->radius();
    pocket.step = uniform(0.1, 0.3) * radius;
    pocket.radius = uniform(8.0, 12.0) * MM;
    pocket.speed = units::radPerSecFromRpm(std::round(uniform(3000.0, 6000.0)));
    pocket.feed = uniform(0.03, 0.07) * MM;
    pocket.corner_margin = uniform(ranges.low_margin, ranges.high_margin);
    const double velocity = pocket.feed * drawn.machine.tool->teeth * pocket.speed / units::TWO_PI;
    const double way = constantWay(pocket, radius);
    if (way / velocity < ranges.least_time || way / velocity > ranges.most_time) continue;
    program::StabilityLimits limits(drawn.machine);
    pocket.depth =
        limitOf(limits, entryOnArc(pocket, radius), pocket.speed, way / pocket.radius) / pocket.corner_margin;
    if (!(pocket.depth >= LEAST_DEPTH && pocket.depth <= MOST_CORNER_DEPTH)) continue;
    const double line = PI - std::acos(1.0 - pocket.step / radius);
    const double on_lines = std::min(limits.limit({{{line, PI, 1.0 * MM}}}, 0.0, false, pocket.speed),
                                     limits.limit({{{line, PI, 1.0 * MM}}}, 0.5 * PI, false, pocket.speed));
    pocket.line_margin = on_lines / pocket.depth;
    if (pocket.line_margin < LINE_MARGIN) continue;
    pocket.levels =
        static_cast<int>(std::ceil(LINE_MARGIN * pocket.depth / limitOf(limits, 0.0, pocket.speed)));
    if (pocket.levels > 12) continue;
    return drawn;
  }
  throw Error("corner: no machine and pocket in " + std::to_string(MOST_TRIES) + " draws");
}

std::string cornerProgram(const CornerPocket& p, const MachineModel& machine) {
  const ToolGeometry& tool = *machine.tool;
  const double half = 0.5 * CornerPocket::SIDE / MM, top = machine.workpiece->high[2] / MM;
  const double out = half + tool.radius() / MM + 5.0, r = p.radius / MM, step = p.step / MM;
  const double x = 0.4 * half, y = -0.4 * half;  // of the finishing pass
  const double feed = p.feed / MM * tool.teeth * units::rpmFromRadPerSec(p.speed);
  std::string text = "%\nO2001 (CORNER)\n";
  int number = 0;
  const auto block = [&](const std::string& words) {
    text += formatted("N%d %s\n", number += 5, words.c_str());
  };
  const auto pass = [&](double inside, double z, double rate) {
    block(formatted("G0 X%.3f Y%.3f", -out, y + inside));
    block(formatted("Z%.4f", top - z));
    block(formatted("G1 X%.3f F%.1f", x - r, rate));
    block(formatted("G3 X%.3f Y%.3f J%.3f", x - inside, y + r, r - inside));
    block(formatted("G1 Y%.3f", out));
    block(formatted("G0 Z%.3f", top + 5.0));
  };
  block("G90 G94 G17 G49 G40 G80");
  block("G21");
  block("G28 G91 Z0.");
  block("G90");
  block("T1 M6");
  block(formatted("S%.0f M3", units::rpmFromRadPerSec(p.speed)));
  block("G54");
  block(formatted("G0 X%.3f Y%.3f", -out, y));
  block(formatted("G43 Z%.3f H1", top + 5.0));
  block("G4 X1.5");
  for (int level = 1; level <= p.levels; ++level) pass(step, p.depth / MM * level / p.levels, 1.5 * feed);
  pass(0.0, p.depth / MM, feed);
  block("M5");
  block("G28 G91 Z0.");
  block("M30");
  return text + "%\n";
}

}  // namespace smartmill
