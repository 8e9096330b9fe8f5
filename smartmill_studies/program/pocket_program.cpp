#include "program/pocket_program.h"

#include <algorithm>

#include "smartmill_core/error.h"
#include "smartmill_core/formatted.h"
#include "smartmill_core/units.h"
#include "smartmill_program/prediction/stability_limits.h"

namespace smartmill {
namespace {

using units::MM;

constexpr double CLEARANCE = 5 * MM;  // above the stock and next to it

}  // namespace

PocketTraits drawPocket(std::mt19937_64& random) {
  const auto uniform = [&](double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(random);
  };
  PocketTraits traits;
  traits.depth = uniform(0.6, 1.2) * MM;
  traits.slot = uniform(50.0, 70.0) * MM;
  traits.step = uniform(0.25, 0.45);
  traits.speed = units::radPerSecFromRpm(uniform(3000.0, 5000.0));
  traits.least_feed = uniform(0.04, 0.06) * MM;
  traits.largest_feed = uniform(0.15, 0.2) * MM;
  return traits;
}

PocketTraits drawStablePocket(std::mt19937_64& random, const MachineModel& machine) {
  constexpr double STABLE = 0.7;  // [1] depth over the limit
  PocketTraits traits = drawPocket(random);
  const program::Contact slot{{{0.0, units::PI, traits.depth}}};
  traits.depth = std::min(traits.depth,
                          STABLE * program::StabilityLimits(machine).limit(slot, 0.0, false, traits.speed));
  return traits;
}

std::string pocketProgram(const PocketTraits& t, const MachineModel& model) {
  const ToolGeometry& tool = model.needTool("mill a pocket");
  if (!model.workpiece) throw Error(model.file + ": workpiece is missing (needed to mill a pocket)");
  const Workpiece& stock = *model.workpiece;
  const double y = 0.5 * (stock.low[1] + stock.high[1]), step = t.step * tool.diameter;
  const double outside = stock.low[0] - tool.radius() - CLEARANCE, end = stock.low[0] + t.slot;
  const double reach = t.rings * step + tool.radius();
  if (end + reach > stock.high[0] || y + reach > stock.high[1])
    throw Error(model.file + ": workpiece is smaller than the pocket");
  std::string text = "G90\n";
  int number = 0;
  const auto block = [&](const std::string& words) {
    text += formatted("N%d %s\n", number += 10, words.c_str());
  };
  const auto feedOf = [&](double per_tooth) {
    return formatted(" F%.1f", per_tooth * tool.teeth * t.speed / units::TWO_PI / MM * 60.0);
  };
  block(formatted("G0 Z%.3f", (stock.high[2] + CLEARANCE) / MM));
  block(formatted("G0 X%.3f Y%.3f", outside / MM, y / MM));
  block(formatted("S%.0f M3", units::rpmFromRadPerSec(t.speed)));
  block("G4 X2.5");
  for (int level = 1; level <= t.levels; ++level) {
    block(formatted("G0 X%.3f Y%.3f", outside / MM, y / MM));
    block(formatted("G0 Z%.3f", (stock.high[2] - level * t.depth) / MM));
    block(formatted("G1 X%.3f", end / MM) + feedOf(t.largest_feed));
    block(formatted("G1 X%.3f", outside / MM));
    for (int ring = 1; ring <= t.rings; ++ring) {
      const double share = (ring - 1.0) / std::max(1, t.rings - 1);
      // Counterclockwise: down-milling.
      block(formatted("G0 Y%.3f", (y - ring * step) / MM));
      block(formatted("G1 X%.3f", (end + ring * step) / MM) +
            feedOf(t.largest_feed + share * (t.least_feed - t.largest_feed)));
      block(formatted("G1 Y%.3f", (y + ring * step) / MM));
      block(formatted("G1 X%.3f", outside / MM));
    }
    block(formatted("G0 Z%.3f", (stock.high[2] + CLEARANCE) / MM));
  }
  block("M30");
  return text;
}

}  // namespace smartmill
