#include "stability/tool_kinds.h"

#include <algorithm>
#include <cmath>
#include <random>

#include "smartmill_core/error.h"
#include "smartmill_core/units.h"
#include "smartmill_stability/solvers/model_system.h"
#include "stability/twin_agreement.h"
#include "stability/twin_cuts.h"

namespace smartmill::stability {
namespace {

// Resolution of a cut.
constexpr double SAMPLES_OF_A_WAVE = 40.0;
constexpr int LEAST_SAMPLES = 180;  // per revolution

std::vector<double> radians(const std::vector<double>& deg) {
  std::vector<double> values;
  for (const double d : deg) values.push_back(units::radFromDeg(d));
  return values;
}

RegenerativeSystem systemOfKind(const MachineModel& model, const ToolKind& kind,
                                const ToolKindOptions& options) {
  RegenerativeSystem system = systemOf(model, options.entry_deg, options.exit_deg);
  if (kind.unlike_chips) {
    system.chip.emplace();
    system.chip->feed = options.feed;
    system.chip->kte = model.cutting->kte;
    system.chip->kre = model.cutting->kre;
  }
  return system;
}

}  // namespace

std::vector<ToolKind> toolKinds(const ToolGeometry& straight) {
  if (straight.teeth != 4) throw Error("tool kinds: expected a tool with four teeth");
  const ToolKind plain{"straight", straight};
  ToolKind bull = plain, ball = plain, face = plain, pitch = plain, helix = plain, serrated = plain;
  bull.name = "bull nose";
  bull.tool.edge.corner_radius = 0.3 * straight.radius();
  ball.name = "ball";
  ball.tool.edge.corner_radius = straight.radius();
  face.name = "face mill";
  face.tool.diameter = 4.0 * straight.diameter;
  face.tool.helix = 0.0;
  face.tool.edge.edge_angle = 0.25 * units::PI;
  pitch.name = "variable pitch";
  pitch.tool.pitch = radians({84.0, 96.0, 84.0, 96.0});
  helix.name = "variable helix";
  helix.tool.setHelix(radians({25.0, 35.0, 25.0, 35.0}));
  serrated.name = "serrated";
  serrated.tool.edge.serration_amplitude = 0.6e-3;
  serrated.tool.edge.serration_wavelength = 3e-3;
  pitch.unlike_chips = helix.unlike_chips = serrated.unlike_chips = true;
  return {plain, bull, ball, face, pitch, helix, serrated};
}

bool CutAtLimit::right(double within) const {
  return chatters == observed || std::abs(depth / limit - 1.0) <= within;
}

std::vector<CutAtLimit> cutsAtLimit(const MachineModel& model, const ToolKind& kind,
                                    const ToolKindOptions& options,
                                    const std::function<void(double)>& progress) {
  options.validate();
  if (options.points < 1 || options.revolutions < 100 || !(options.reach > 0.0 && options.reach < 0.5))
    throw Error("tool kinds: expected points, 100 revolutions or more and a reach of 0..50 %");
  MachineModel machine = model;
  machine.tool = kind.tool;
  const RegenerativeSystem system = systemOfKind(machine, kind, options);
  SolverOptions accuracy;
  if (kind.unlike_chips) accuracy = SolverOptions::ofManyPoints();
  const auto solver = makeFloquetSolver(Method::collocation, system, accuracy);
  double highest = 0.0;
  for (const SystemMode& mode : system.modes) highest = std::max(highest, mode.frequency);
  std::mt19937_64 random(options.seed);
  std::uniform_real_distribution<double> unit;
  std::vector<CutAtLimit> points;
  std::vector<TwinCut> cuts;
  for (int tries = 0; static_cast<int>(points.size()) < options.points; ++tries) {
    if (tries > 10 * options.points + 100) throw Error("tool kinds: no limits found up to the largest depth");
    CutAtLimit p;
    p.speed = options.speed_low + (options.speed_high - options.speed_low) * unit(random);
    const double share = 1.0 + options.reach * (2.0 * unit(random) - 1.0);
    const Limit limit = solver->limit(p.speed, options.max_depth);
    if (!std::isfinite(limit.depth)) continue;
    p.limit = limit.depth;
    p.kind = limit.kind;
    p.depth = share * limit.depth;
    p.chatters = solver->multiplier(p.speed, p.depth).radius() > 1.0;
    const int samples = wholeTeeth(
        std::max(LEAST_SAMPLES,
                 static_cast<int>(std::ceil(SAMPLES_OF_A_WAVE * highest * units::TWO_PI / p.speed))),
        system.teeth);
    cuts.push_back(
        {p.speed, {system.entry, system.exit, p.depth, options.feed}, samples, options.revolutions, 0});
    points.push_back(p);
  }
  runTwinCuts(
      {machine}, cuts, {{"tool_x", "tool_y"}},
      [&](std::size_t i, const Record& record) {
        const int period =
            system.evenPitch() && !kind.unlike_chips ? cuts[i].samples / system.teeth : cuts[i].samples;
        points[i].observed = repeatsNoMore(record, cuts[i].samples, period, options.feed);
      },
      progress);
  return points;
}

}  // namespace smartmill::stability
