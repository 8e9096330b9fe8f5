// rosrun smartmill_studies program_feed_plan: time that a feed plan saves at the peak force and feed per
// tooth of the program itself, and the limits against the twin in time at the worst engagement of every
// block.

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <map>
#include <random>
#include <string>
#include <utility>

#include <unistd.h>

#include "program/pocket_program.h"
#include "program/ring_pocket.h"
#include "smartmill_core/formatted.h"
#include "smartmill_core/io/text_file.h"
#include "smartmill_core/program.h"
#include "smartmill_core/units.h"
#include "smartmill_program/plan/feed_planner.h"
#include "smartmill_sim/twin/milling_process.h"
#include "study_case.h"

namespace {

using namespace smartmill;
using namespace smartmill::program;
using units::MM;

constexpr int STEPS = 1440;  // of the twin in a revolution
constexpr int REVOLUTIONS = 2;
constexpr double COLUMN = 0.1 * MM;
constexpr double RESOLUTION = 1e-3;  // [1] of a feed word and of the predicted peak

struct Arguments {
  std::string model = "launch/models/mill_twin.yaml", program = "launch/programs/shoulder.nc";
  int pockets = 20;
  std::uint64_t seed = 1;
};

/// A program with its stock and model file.
struct Job {
  std::string name, text, model;
  StockBlock stock;
};

/// The largest force [N] across the tool axis in the twin with a rigid tool, from steady cutting on.
double twinPeak(const MachineModel& model, const Step& step) {
  const Move& move = *step.move;
  const double dt = units::TWO_PI / move.spindle_speed / STEPS, feed = move.feed * step.feed_share;
  CuttingLaw law;
  law.coefficients = *model.cutting;
  sim::MillingProcess process(*model.tool, law, dt);
  sim::ToolMotion motion;
  motion.speed = move.spindle_speed;
  motion.velocity = {feed, 0.0};
  std::vector<ContactArc> arcs;  // of a flat end mill
  for (const program::EngagedArc& arc : step.contact.arcs) arcs.push_back({arc.entry, arc.exit, arc.top});
  process.engage(arcs, motion);
  double peak = 0.0;
  for (int k = 0; k < REVOLUTIONS * STEPS; ++k) {
    motion.angle = units::TWO_PI * k / STEPS;
    motion.centre = {feed * k * dt, 0.0};
    const CuttingForce force = process.step(motion);
    process.endStep({0.0, 0.0});
    peak = std::max(peak, std::hypot(force.fx, force.fy));
  }
  return peak;
}

/// The worst step of each executed block of a program.
struct Worst {
  Step step;
  double force = 0.0;  // [N] predicted
};

struct Score {
  int blocks = 0, below = 0, held = 0;  // with force; twin at most the limit, and within RESOLUTION
  double largest = 0.0;                 // [1] twin over limit
};

/// Plans a job with the force and feed per tooth of the program itself.
/// @param raised whether a feed may exceed the largest one of the program
void planJob(const Job& job, bool raised, Score& total) {
  ToolModels models({job.model});
  const MachineModel model = readMachineModel(job.model);
  const std::vector<Move> moves = interpretProgram(job.text, job.name);
  const Stock stock(job.stock, COLUMN);
  AnalysisOptions options;
  options.stability = false;
  options.simulation.rapid = model.axes->rapid;

  FeedLimits limits;
  limits.machine = model.axes->rapid;
  limits.acceleration = model.axes->acceleration;
  double largest_feed = 0.0;
  for (const Move& move : moves)
    if (!move.rapid) largest_feed = std::max(largest_feed, move.feed);
  if (!raised) limits.machine = largest_feed;
  Stock first = stock;
  limits.force = limits.feed_per_tooth = 0.0;
  ProgramAnalysis(job.name, models, first, options)
      .run(moves, [&](const Step& step, const StepPrediction& p) {
        if (step.contact.empty() || step.move->rapid) return;
        limits.force = std::max(limits.force, p.force.peak_force);
        limits.feed_per_tooth = std::max(limits.feed_per_tooth, p.feed_per_tooth);
      });
  FeedPlanner planner(job.name, job.text, {}, models, limits);
  Stock second = stock;
  const AnalysisResult before =
      ProgramAnalysis(job.name, models, second, options)
          .run(moves, [&](const Step& step, const StepPrediction&) { planner.add(step); });
  const FeedPlan plan = planner.plan({moves, before}, {moves, before}, stock, options);

  const std::vector<Move> planned = interpretProgram(plan.text, job.name);
  std::map<std::size_t, Worst> worst;
  Stock third = stock;
  ProgramAnalysis(job.name, models, third, options)
      .run(planned, [&](const Step& step, const StepPrediction& p) {
        if (step.contact.empty() || step.move->rapid) return;
        Worst& of = worst[step.move->block];
        if (p.force.peak_force > of.force) of = {step, p.force.peak_force};
      });
  Score score;
  for (const auto& [block, of] : worst) {
    const double ratio = twinPeak(model, of.step) / limits.force;
    ++score.blocks;
    score.below += ratio <= 1.0;
    score.held += ratio <= 1.0 + RESOLUTION;
    score.largest = std::max(score.largest, ratio);
  }
  std::map<FeedLimit, double> binds;
  double at_feed = 0.0;
  for (const PlannedBlock& block : plan.blocks) {
    binds[block.limit] += block.new_time;
    at_feed += block.new_time;
  }
  std::printf(
      "%-12s %-4s %6.1f N %5.3f mm  %7.1f %7.1f s %5.1f %%  %7.1f %7.1f s %5.1f %%  %4d %4d %4d %7.4f ",
      job.name.c_str(), raised ? "any" : "own", limits.force, limits.feed_per_tooth / MM,
      plan.old_steady_time, plan.new_steady_time, 100.0 * (1.0 - plan.new_steady_time / plan.old_steady_time),
      plan.old_time, plan.new_time, 100.0 * (1.0 - plan.new_time / plan.old_time), score.blocks, score.below,
      score.held, score.largest);
  for (const auto& [limit, time] : binds) std::printf(" %s %.0f %%", nameOf(limit), 100.0 * time / at_feed);
  std::printf("\n");
  std::fflush(stdout);
  total.blocks += score.blocks;
  total.below += score.below;
  total.held += score.held;
  total.largest = std::max(total.largest, score.largest);
}

/// A model with a tool of 10 mm and the axes and coefficients of another.
std::string ringModel() {
  const std::string file = formatted("/tmp/feed_plan_%d.yaml", static_cast<int>(getpid()));
  writeText(file,
            "format: smartmill-model/1\ntool: {teeth: 4, diameter_mm: 10.0, helix_deg: 30.0}\ncutting: "
            "{Ktc_n_per_mm2: 796.0, Krc_n_per_mm2: 168.0, Kac_n_per_mm2: 222.0, Kte_n_per_mm: 27.7, "
            "Kre_n_per_mm: 30.8, Kae_n_per_mm: 1.4}\n"
            "axes: {x_travel_mm: [-250.0, 250.0], y_travel_mm: [-200.0, 200.0], z_travel_mm: [-300.0, 0.0], "
            "rapid_mm_per_min: 24000.0, acceleration_mm_per_s2: 5000.0, home_mm: [0.0, 0.0, 0.0]}\n");
  return file;
}

void run(const Arguments& a) {
  const MachineModel model = readMachineModel(a.model);
  const StockBlock block{model.workpiece->low, model.workpiece->high};
  const std::string ring_model = ringModel();
  std::vector<Job> jobs{
      {"shoulder", readText(a.program), a.model, block},
      {"ring pocket", ringPocket(), ring_model, {{0, 0, -20 * MM}, {120 * MM, 80 * MM, 0}}}};
  for (int i = 0; i < a.pockets; ++i) {
    std::mt19937_64 random(seedOfCase(a.seed, i));
    jobs.push_back({formatted("pocket %d", i), pocketProgram(drawPocket(random), model), a.model, block});
  }
  std::printf(
      "program      feed  limits            constant feeds: before, after, saved; rest to rest: before, "
      "after, "
      "saved; blocks, twin below the limit, within %.1f %%, largest over limit; limit that binds\n",
      100.0 * RESOLUTION);
  Score total;
  for (const bool raised : {true, false})
    for (const Job& job : jobs) planJob(job, raised, total);
  ::unlink(ring_model.c_str());
  std::printf("%d blocks, twin at most the limit in %d, within %.1f %% in %d, largest over limit %.5f\n",
              total.blocks, total.below, 100.0 * RESOLUTION, total.held, total.largest);
}

}  // namespace

int main(int argc, char** argv) {
  CommandLine line(
      "Feed plans at the peak force and feed per tooth of the program itself: time saved, and the limit "
      "against "
      "the twin in time at the worst engagement of every block.");
  Arguments a;
  line.option("--model", a.model, "machine model with tool, coefficients, axes and workpiece").showDefault();
  line.option("--program", a.program, "NC program in the workpiece of the model").showDefault();
  line.option("--pockets", a.pockets, "number of random pockets").showDefault();
  line.option("--seed", a.seed, "of the pockets").showDefault();
  return runProgram(line, argc, argv, [&] { run(a); });
}
