// rosrun smartmill_studies program_tooth_loss: a tooth broken off in a drawn cut of drawn machines, and false
// reports in hours of production without a loss. Developed with seeds 1 to 3, 2028 to 2030 (the last two
// after a count of each), 3001 to 3004, 3101 and, after counts of each, 2031 to 2033; counted with seed 2034:
//   --cases 50 --seed 2034; --cases 50 --seed 2034 --least-load 0; --cases 200 --seed 2034 --hours 0.5

#include <cmath>
#include <cstdio>
#include <optional>
#include <random>
#include <string>

#include <nlohmann/json.hpp>

#include "program/production_force.h"
#include "smartmill_core/program.h"
#include "smartmill_core/units.h"
#include "smartmill_program/tool/tooth_watch.h"
#include "study_case.h"

namespace {

using namespace smartmill;
using namespace smartmill::program;

struct Arguments {
  int cases = 50;
  std::uint64_t seed = 1;
  double hours = 0.0;        // of each case; 0: losses
  double least_load = 20.0;  // [N]
};

constexpr double LEAST_BEFORE = 2.0, MOST_BEFORE = 20.0;  // [s] of loaded cutting before the loss
constexpr double AFTER = 10.0;                            // [revolutions] after it
constexpr double LIMIT = 2.0;                             // [revolutions] until the report

/// The detection with what it receives in the graph: samples, and the feed by each poll of the controller.
class Watch {
 public:
  explicit Watch(const ToolGeometry& tool) { watch_.setTool(tool); }

  /// Passes the last sample on; lost ones end the sequence.
  std::optional<ToothLoss> push(const ProductionForce& force) {
    const ProductionForce::Sample& sample = force.last();
    if (sample.time >= poll_) {
      watch_.setFeed(force.feedPerTooth());
      poll_ += POLL;
    }
    if (!sample.lost) return watch_.push({sample.time, sample.turned, sample.fx, sample.fy});
    watch_.reset();
    return {};
  }

 private:
  static constexpr double POLL = 0.02;  // [s]

  ToothWatch watch_{ToothWatchParameters()};
  double poll_ = 0.0;  // [s]
};

/// A tooth is lost after a drawn time of cutting with at least the least load.
nlohmann::json lossCase(const Arguments& a, int number) {
  std::mt19937_64 random(seedOfCase(a.seed, number));
  const ProductionMachine machine = drawMachine(random);
  ProductionForce force(machine, random());
  const double at = std::uniform_real_distribution<double>(LEAST_BEFORE, MOST_BEFORE)(random);
  const int tooth = std::uniform_int_distribution<int>(0, machine.tool.teeth - 1)(random);
  Watch watch(machine.tool);
  std::optional<double> broken;  // [1] revolutions
  nlohmann::json line{{"case", number}, {"teeth", machine.tool.teeth}, {"tooth", tooth + 1}, {"false", 0}};
  line["revolutions"] = nullptr;
  double speed = 0.0;
  double loaded = 0.0;  // [s] of cutting
  while (!broken || force.last().revolutions < *broken + AFTER) {
    const ProductionForce::Sample& sample = force.next();
    if (sample.cutting && force.meanForce() >= a.least_load) loaded += 1.0 / ProductionForce::RATE;
    if (!broken && loaded >= at && sample.cutting) {
      force.breakTooth(tooth);
      broken = sample.revolutions;
      line["stage"] = force.stage();
    }
    if (const std::optional<ToothLoss> loss = watch.push(force)) {
      if (!broken) {
        line["false"] = line["false"].get<int>() + 1;
        continue;
      }
      line["revolutions"] = sample.revolutions - *broken;
      line["named"] = loss->tooth + 1;
      line["loss"] = loss->loss;
      line["loss_std"] = loss->loss_std;
      break;
    }
    speed = sample.revolutions / sample.time;
  }
  line["rpm"] = 60.0 * speed;
  return line;
}

/// Production with a sharp tool that wears, a new one every half an hour.
nlohmann::json productionCase(const Arguments& a, int number) {
  constexpr double TOOL_LIFE = 1800.0;  // [s]
  std::mt19937_64 random(seedOfCase(a.seed, 1000000 + number));
  nlohmann::json line{{"case", number}, {"hours", a.hours}, {"false", 0}};
  nlohmann::json stages = nlohmann::json::array();
  double cutting = 0.0, revolutions = 0.0;
  for (double time = 0.0; time < a.hours * 3600.0 - 1e-6; time += TOOL_LIFE) {
    const double life = std::min(TOOL_LIFE, a.hours * 3600.0 - time);
    const ProductionMachine machine = drawMachine(random);
    ProductionForce force(machine, random());
    Watch watch(machine.tool);
    for (double at = 0.0; at < life; at = force.last().time) {
      force.next();
      if (!watch.push(force)) continue;
      line["false"] = line["false"].get<int>() + 1;
      stages.push_back(
          {{"stage", force.stage()}, {"time", force.last().time}, {"teeth", machine.tool.teeth}});
    }
    cutting += force.cuttingTime();
    revolutions += force.last().revolutions;
  }
  line["cutting_hours"] = cutting / 3600.0;
  line["revolutions"] = revolutions;
  line["reports"] = stages;
  return line;
}

void score(const std::string& file) {
  int losses = 0, within = 0, reported = 0, named = 0, false_before = 0, alarms = 0, inside = 0;
  double hours = 0.0, cutting = 0.0, revolutions = 0.0, sum = 0.0, worst = 0.0;
  for (const nlohmann::json& line : readJsonLines(file)) {
    if (line.contains("hours")) {
      hours += line.at("hours").get<double>();
      cutting += line.at("cutting_hours").get<double>();
      revolutions += line.at("revolutions").get<double>();
      alarms += line.at("false").get<int>();
      continue;
    }
    ++losses;
    false_before += line.at("false").get<int>();
    const double after = numberOf(line, "revolutions");
    if (!std::isfinite(after)) continue;
    ++reported;
    within += after <= LIMIT;
    named += line.at("named") == line.at("tooth");
    inside += std::abs(numberOf(line, "loss") - 1.0) <= 1.96 * numberOf(line, "loss_std");
    sum += after;
    worst = std::max(worst, after);
  }
  if (losses > 0)
    std::printf(
        "losses %d: reported within %.0f revolutions %d, at all %d, mean %.2f and largest %.2f revolutions; "
        "tooth right %d; loss within 1.96 deviations of 1 %d; false reports before %d\n",
        losses, LIMIT, within, reported, sum / std::max(reported, 1), worst, named, inside, false_before);
  if (hours > 0.0)
    std::printf("production %.2f h, of these in the cut %.2f h, %.3g revolutions: false reports %d\n", hours,
                cutting, revolutions, alarms);
}

}  // namespace

int main(int argc, char** argv) {
  CommandLine line(
      "A tooth broken off at a drawn time in drawn machines: revolutions until it is reported. With --hours: "
      "false reports in production without a loss.");
  Arguments a;
  StudyCase study;
  study.addTo(line, "--cases", a.cases, "number of machines with a loss, or of cases of --hours");
  line.option("--seed", a.seed, "of all draws").showDefault();
  line.option("--hours", a.hours, "[h] simulated production of each case without a loss; 0: losses")
      .showDefault();
  line.option("--least-load", a.least_load, "[N] mean force of the last 0.1 s at which a tooth may break")
      .showDefault();
  study.addScore(line);
  return runProgram(line, argc, argv, [&] {
    if (study.scores()) return score(study.lines);
    study.check(a.cases);
    for (int k = 0; k < a.cases; ++k) {
      if (study.one() && k != study.number) continue;
      study.print(a.hours > 0.0 ? productionCase(a, k) : lossCase(a, k));
      std::fflush(stdout);
    }
  });
}
