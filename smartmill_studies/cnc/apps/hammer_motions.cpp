// rosrun smartmill_studies cnc_hammer_motions: motions of the automatic hammer on the simulated machine with
// random tools, positions, model errors and faults. The tool must never touch sensor, hammer or table, no
// motion may leave the travel, and nothing may move after a motion is cancelled. Every refusal has a message
// and is counted.

#include <cmath>
#include <cstdio>
#include <map>
#include <optional>
#include <random>
#include <string>
#include <vector>

#include "smartmill_cnc/motion/nc_program.h"
#include "smartmill_core/axis_names.h"
#include "smartmill_core/nc/orientation.h"
#include "smartmill_core/program.h"
#include "smartmill_core/units.h"
#include "smartmill_hammer/sequence/hammer_sequence.h"
#include "smartmill_sim/controller/nc_alarm.h"
#include "smartmill_sim/world/world.h"
#include "study_case.h"

namespace {

using namespace smartmill;

constexpr double BLOCK_TIME = sim::World::BLOCK / sim::World::SAMPLE_RATE;  // [s]
constexpr double MOST_TIME = 240.0;                                         // [s] of a run
constexpr double STATE_PERIOD = 0.02;                                       // [s]
constexpr double NARROW_SHARE = 0.1;
constexpr double MM = units::MM;

enum class Trouble { none, cancel, alarm, emergency, reset, hold, mode };
constexpr const char* TROUBLES[] = {"none",  "cancel",    "alarm", "emergency stop",
                                    "reset", "feed hold", "mode"};
constexpr const char* CODES[] = {"ok",       "cancelled", "no flute",  "no hit", "motion failed",
                                 "bad goal", "bad data",  "fit failed"};

struct Draw {
  MachineModel truth, believed;
  MeasureFrfGoal goal;
  Trouble trouble = Trouble::none;
  double trouble_time = 0.0;  // [s]
  double start_angle = 0.0;   // [rad]
  Axes3 start{{0, 0, 0}};     // [m]
};

struct Counts {
  int runs = 0, collisions = 0, beyond_limits = 0, moved_unasked = 0, unfinished = 0;
  int refused_by_limits = 0, refused_by_state = 0;
  std::map<std::string, int> results, by_trouble;
};

double uniform(std::mt19937_64& random, double low, double high) {
  return std::uniform_real_distribution<double>(low, high)(random);
}

Draw drawRun(const MachineModel& model, std::mt19937_64& random, double trouble_share) {
  Draw d;
  d.truth = model;
  d.truth.tool->teeth = std::uniform_int_distribution<int>(2, 6)(random);
  d.truth.tool->diameter = uniform(random, 10.0, 25.0) * MM;
  d.truth.tool->helix = units::radFromDeg(uniform(random, 0.0, 40.0));
  d.believed = d.truth;
  // The station is positioned by hand, the tool is measured with a gauge.
  for (auto& [direction, place] : d.believed.hammer->position) {
    for (double& at : place) at += uniform(random, -0.1, 0.1) * MM;
  }
  d.believed.tool->diameter += uniform(random, -0.05, 0.05) * MM;
  d.goal.tool = "drawn";
  d.goal.point = POINT_TOOL_TIP;
  d.goal.direction = uniform(random, 0.0, 1.0) < 0.5 ? "x" : "y";
  d.goal.hits = 1;
  d.goal.modes = 1;
  d.goal.teeth = d.truth.tool->teeth;
  if (d.truth.stickout) d.goal.stickout = *d.truth.stickout;
  if (uniform(random, 0.0, 1.0) < trouble_share) {
    d.trouble = static_cast<Trouble>(std::uniform_int_distribution<int>(1, 6)(random));
    d.trouble_time = uniform(random, 0.5, 40.0);
  }
  if (uniform(random, 0.0, 1.0) < NARROW_SHARE) {
    // Limits that exclude the station: the bridge must refuse the motion before it sends it.
    d.believed.axes->travel[0][1] = d.believed.hammer->position.at("x")[0] - 5.0 * MM;
  }
  const auto& travel = d.believed.axes->travel;
  d.start = {uniform(random, travel[0][0], travel[0][1]), uniform(random, travel[1][0], travel[1][1]),
             uniform(random, -20.0 * MM, travel[2][1])};
  return d;
}

/// Executes the commands of the sequence as the bridge does: armed once, one checked program at a time.
class Driver {
 public:
  Driver(const Draw& draw, std::uint64_t seed, Counts& counts)
      : draw_(draw),
        counts_(counts),
        world_(started(draw), worldOptions(seed)),
        sequence_({}, draw.believed) {
    limits_.travel = draw.believed.axes->travel;
    limits_.max_feed = draw.believed.axes->rapid;
    limits_.max_spindle_speed = draw.believed.spindle->max_speed.value_or(2000.0);
  }

  void run() {
    sequence_.handle(draw_.goal);
    std::optional<hammer::MeasureFrfResult> result;
    while (!result && time_ < MOST_TIME) {
      meddle();
      advance();
      result = sequence_.takeResult();
    }
    counts_.unfinished += result ? 0 : 1;
    ++counts_.results[result ? CODES[static_cast<std::size_t>(result->code)] : "no result"];
    if (result && result->code != FrfCode::ok && result->message.empty())
      ++counts_.results["without a message"];
    standStill();
    judge();
  }

 private:
  static MachineModel started(const Draw& draw) {
    MachineModel model = draw.truth;
    model.axes->home = draw.start;
    return model;
  }
  static sim::WorldOptions worldOptions(std::uint64_t seed) {
    sim::WorldOptions options;
    options.seed = seed;
    options.substeps = 1;
    return options;
  }
  sim::Controller& controller() { return world_.controller(); }
  focas::ControllerInterface calls() { return controller().calls(); }

  void meddle() {
    if (draw_.trouble == Trouble::hold && held_ && time_ > draw_.trouble_time + 2.0) {
      calls().programs.cycleStart();
      held_ = false;
    }
    if (troubled_ || draw_.trouble == Trouble::none || time_ < draw_.trouble_time) return;
    troubled_ = true;
    switch (draw_.trouble) {
      case Trouble::cancel:
        sequence_.cancel(time_);
        break;
      case Trouble::alarm:
        controller().raiseAlarm(1001, "DRAWN");
        break;
      case Trouble::emergency:
        controller().emergency(true);
        break;
      case Trouble::reset:
        calls().programs.reset();
        break;
      case Trouble::hold:
        controller().feedHold();
        held_ = true;
        break;
      case Trouble::mode:
        controller().setMode(focas::AUT_JOG);
        break;
      case Trouble::none:
        break;
    }
  }

  void advance() {
    feed();
    sim::World::Block block;
    world_.advance(block);
    time_ += BLOCK_TIME;
    watch();
    sequence_.handle(block.hammer);
    if (time_ - last_state_ >= STATE_PERIOD) {
      last_state_ = time_;
      sequence_.handle(state());
    }
    for (const SpindleAngle& angle : block.angle) sequence_.handle(angle);
    for (const hammer::Command& command : sequence_.takeCommands()) obey(command);
  }

  /// Program text that the controller has not accepted yet.
  void feed() {
    if (!session_ || text_.empty()) return;
    text_.erase(0, calls().dnc.dncData(text_.data(), text_.size()));
  }

  /// State that the bridge reads when the machine ends a motion by itself.
  void watch() {
    const focas::Status status = calls().state.status();
    const focas::EwCode code = calls().dnc.dncAbort();
    const bool taken =
        code != focas::EW_OK || status.alarm != 0 || status.emergency != 0 || status.aut != focas::AUT_REMOTE;
    if (taken && armed_) {
      armed_ = session_ = false;
      text_.clear();
      sequence_.commandFailed(time_, "ended by the controller: " + focas::ewName(code));
    }
    const sim::MotionState motion = controller().motion();
    for (std::size_t i = 0; i < 3; ++i) {
      const auto& travel = draw_.truth.axes->travel[i];
      beyond_ = beyond_ || motion.position[i] < travel[0] - 1e-9 || motion.position[i] > travel[1] + 1e-9;
    }
  }

  CncState state() {
    const focas::Status status = calls().state.status();
    CncState s;
    s.stamp = time_;
    s.connected = true;
    s.armed = armed_;
    s.mode = static_cast<CncMode>(status.aut);
    s.run = static_cast<CncRun>(status.run);
    s.motion = status.motion == focas::MOTION_MOVES;
    s.emergency = status.emergency != 0;
    s.alarm = status.alarm != 0;
    s.axes = {"X", "Y", "Z"};
    for (const double mm : calls().axes.machinePosition()) s.position.push_back(mm * MM);
    for (const double mm : calls().axes.distanceToGo()) s.distance_to_go.push_back(mm * MM);
    s.spindle_speed = controller().motion().spindle_speed;
    return s;
  }

  void obey(const hammer::Command& command) {
    using Kind = hammer::Command::Kind;
    std::string message;
    if (command.kind == Kind::stop) {
      calls().dnc.dncCancel(focas::DNC_CANCEL);
      session_ = false;
      text_.clear();
    } else if (command.kind == Kind::strike) {
      if (world_.strike("tool", command.direction, message) != sim::World::StrikeAnswer::ok) {
        sequence_.commandFailed(time_, message);
      }
    } else if (command.kind == Kind::orient) {
      start(cnc::orientProgram(command.angle, nc::ORIENT_VARIABLE));
    } else if (command.kind == Kind::jog) {
      start(cnc::jogProgram(static_cast<int>(*axisIndex(command.axis)), command.distance, command.feed, 4));
    } else {
      start(hammer::moveProgram(command.from, command.path));
    }
  }

  void start(const std::string& program) {
    if (!armed_) {
      ++counts_.refused_by_state;
      sequence_.commandFailed(time_, "motion is not armed");
      return;
    }
    cnc::StartPosition from;
    const CncState now = state();
    for (std::size_t i = 0; i < 3; ++i) from.machine[i] = from.absolute[i] = now.position[i];
    cnc::DialectOptions dialect;
    dialect.decimals = 4;
    const cnc::NcCheck check = cnc::checkProgram(program, from, limits_, dialect);
    if (check.verdict != cnc::NcVerdict::good) {
      ++counts_.refused_by_limits;
      sequence_.commandFailed(time_, check.message);
      return;
    }
    if (!session_ && calls().dnc.dncStart() != focas::EW_OK) {
      ++counts_.refused_by_state;
      sequence_.commandFailed(time_, "the controller accepts no program");
      return;
    }
    session_ = true;
    text_ += check.text;
  }

  /// Checks that nothing moves after the last command of the measurement.
  void standStill() {
    sim::World::Block block;
    for (int i = 0; i < 100; ++i) world_.advance(block);
    const auto before = controller().motion().position;
    for (int i = 0; i < 200; ++i) world_.advance(block);
    moved_ = controller().motion().position != before;
  }

  void judge() {
    bool collision = false, overtravel = beyond_;
    for (const focas::AlarmMessage& alarm : calls().state.alarmMessages()) {
      collision = collision || alarm.number == sim::EX_COLLISION;
      overtravel = overtravel || alarm.type == sim::ALARM_OT;
      if (alarm.number == sim::EX_COLLISION || alarm.type == sim::ALARM_OT) {
        std::fprintf(stderr, "run %d: %s at %.1f s\n", counts_.runs, alarm.text.c_str(), time_);
      }
    }
    ++counts_.runs;
    counts_.collisions += collision ? 1 : 0;
    counts_.beyond_limits += overtravel ? 1 : 0;
    counts_.moved_unasked += moved_ ? 1 : 0;
    ++counts_.by_trouble[TROUBLES[static_cast<std::size_t>(draw_.trouble)]];
  }

  const Draw& draw_;
  Counts& counts_;
  sim::World world_;
  hammer::HammerSequence sequence_;
  cnc::MotionLimits limits_;
  std::string text_;
  double time_ = 0.0, last_state_ = -1.0;
  bool armed_ = true, session_ = false, troubled_ = false, held_ = false, beyond_ = false, moved_ = false;
};

void print(const Counts& c) {
  std::printf("%d runs: %d collisions, %d beyond limits, %d moved without a command, %d without a result\n",
              c.runs, c.collisions, c.beyond_limits, c.moved_unasked, c.unfinished);
  std::printf("refused before anything was sent: %d by limits, %d by state\nresults:", c.refused_by_limits,
              c.refused_by_state);
  for (const auto& [name, count] : c.results) std::printf(" %s %d,", name.c_str(), count);
  std::printf("\ntroubles:");
  for (const auto& [name, count] : c.by_trouble) std::printf(" %s %d,", name.c_str(), count);
  std::printf("\n");
}

struct Request {
  std::string model;
  int runs = 1000;
  std::uint64_t seed = 1;
  double trouble_share = 0.4;
  StudyCase one;
};

void runOnce(const Request& request, const MachineModel& model, int number, Counts& counts) {
  std::seed_seq mix{request.seed, static_cast<std::uint64_t>(number)};
  std::mt19937_64 random(mix);
  const Draw draw = drawRun(model, random, request.trouble_share);
  Driver(draw, request.seed + static_cast<std::uint64_t>(number), counts).run();
}

nlohmann::json lineOf(int number, const Counts& c) {
  return {{"case", number},
          {"collisions", c.collisions},
          {"beyond_limits", c.beyond_limits},
          {"moved_unasked", c.moved_unasked},
          {"unfinished", c.unfinished},
          {"refused_by_limits", c.refused_by_limits},
          {"refused_by_state", c.refused_by_state},
          {"results", c.results},
          {"troubles", c.by_trouble}};
}

/// Counts over the lines of all runs.
Counts countsOf(const std::string& file) {
  Counts all;
  for (const nlohmann::json& line : readJsonLines(file)) {
    ++all.runs;
    all.collisions += line.at("collisions").get<int>();
    all.beyond_limits += line.at("beyond_limits").get<int>();
    all.moved_unasked += line.at("moved_unasked").get<int>();
    all.unfinished += line.at("unfinished").get<int>();
    all.refused_by_limits += line.at("refused_by_limits").get<int>();
    all.refused_by_state += line.at("refused_by_state").get<int>();
    for (const auto& [name, count] : line.at("results").items()) all.results[name] += count.get<int>();
    for (const auto& [name, count] : line.at("troubles").items()) all.by_trouble[name] += count.get<int>();
  }
  return all;
}

int run(const Request& request) {
  request.one.check(request.runs);
  Counts counts;
  if (request.one.scores()) {
    counts = countsOf(request.one.lines);
  } else {
    const MachineModel model = readMachineModel(request.model);
    if (request.one.one()) {
      runOnce(request, model, request.one.number, counts);
      request.one.print(lineOf(request.one.number, counts));
      return 0;
    }
    for (int i = 0; i < request.runs; ++i) {
      runOnce(request, model, i, counts);
      if ((i + 1) % 10 == 0) {
        print(counts);
        std::fflush(stdout);
      }
    }
  }
  print(counts);
  return counts.collisions + counts.beyond_limits + counts.moved_unasked + counts.unfinished > 0 ? 1 : 0;
}

}  // namespace

int main(int argc, char** argv) {
  Request request;
  CommandLine line{
      "Motions of the automatic hammer on the simulated machine with random tools, starts, model errors "
      "(station "
      "0.1 mm, diameter 0.05 mm) and faults; exit code 1 if the tool touches anything, leaves its limits or "
      "moves without a command."};
  line.option("MODEL", request.model, "machine model with a hammer station").required();
  request.one.addTo(line, "--runs,--cases", request.runs, "number of runs");
  request.one.addScore(line);
  line.option("--seed", request.seed, "of the first run; each further run uses the next one").showDefault();
  line.option("--troubles", request.trouble_share,
              "share of runs with an alarm, stop, reset, hold, cancel or change of mode")
      .within(0.0, 1.0)
      .showDefault();
  return runProgram(line, argc, argv, [&] { return run(request); });
}
