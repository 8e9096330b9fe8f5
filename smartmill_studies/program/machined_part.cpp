#include "program/machined_part.h"

#include <chrono>
#include <random>
#include <thread>
#include <utility>

#include "smartmill_cnc/bridge.h"
#include "smartmill_core/error.h"
#include "smartmill_focas/server.h"
#include "smartmill_program/live/path_follower.h"
#include "smartmill_program/nc/program_reader.h"

namespace smartmill {
namespace {

constexpr double PERIOD = 0.02;                     // [s] of the controller's states
constexpr double LATE = 0.005;                      // [s] largest delay of a stamp
constexpr double MOST_TIME = 600.0;                 // [s] of a part
constexpr std::chrono::microseconds TRANSFER(200);  // for the server's thread

cnc::MotionParameters motionOf(const MachineModel& model) {
  cnc::MotionParameters motion;
  motion.read_only = false;
  motion.limits.travel = model.axes->travel;
  motion.limits.max_feed = model.axes->rapid;
  motion.limits.max_spindle_speed = *model.spindle->max_speed;
  return motion;
}

/// As an operator: stores the program, selects it and presses cycle start.
void startFromMemory(sim::Controller& controller, const std::string& text) {
  const int number = std::stoi(text.substr(text.find('O') + 1));
  controller.setMode(focas::AUT_MEM);
  focas::ProgramsInterface& programs = controller.calls().programs;
  for (const focas::EwCode code :
       {programs.storePrograms(text), programs.selectProgram(number), programs.cycleStart()})
    if (code != focas::EW_OK) throw Error(std::string("program: ") + focas::ewName(code));
}

}  // namespace

std::shared_ptr<const program::LiveProgram> preparedPart(const std::string& text,
                                                         const std::vector<std::string>& tools,
                                                         const MachineModel& model) {
  program::ToolModels models(tools);
  program::Stock stock(program::stockBlock(*model.workpiece, {}), 1e-4);
  return std::make_shared<const program::LiveProgram>(
      program::prepareProgram("pocket.nc", program::interpretProgram(text, "pocket.nc"), models, stock,
                              program::SimulationOptions(), program::StretchParameters()));
}

MachinedPart machinePart(const MachineModel& machine, const MachineModel& nominal, const std::string& text,
                         const std::shared_ptr<const program::LiveProgram>& program, std::uint64_t seed,
                         const PartStreams& streams, const PartSetUp& set_up) {
  std::mt19937_64 random(seed);
  std::uniform_real_distribution<double> late(0.0, LATE);
  sim::WorldOptions options;
  options.seed = seed;
  options.magazine = set_up.magazine;
  sim::World world(machine, options);
  focas::ServerOptions server_options;
  server_options.port = 0;
  focas::Server server(server_options, world.controller().calls());
  cnc::FocasParameters focas;
  focas.port = server.port();
  focas.reply_timeout = 20.0;
  cnc::Bridge bridge(cnc::makeFocasController(focas), 1.0, motionOf(nominal));
  program::PathFollower follower(program, {{0, 0, 0}}, {"end_mill", nominal.workpiece->material},
                                 program::FollowerParameters());

  MachinedPart part;
  sim::World::Block block;
  double now = 0.0;
  bool started = false, running = false;
  while (now < MOST_TIME) {
    for (int i = 0; i < 2; ++i) {
      world.advance(block);
      streams.sensors(block);
    }
    now += PERIOD;
    bridge.fetch(now);
    bridge.step(now + late(random));
    std::this_thread::sleep_for(TRANSFER);
    const CncState& state = bridge.state();
    if (state.connected) {
      streams.state(state);
      if (bridge.load()) streams.load(*bridge.load());
      if (const auto condition = follower.handle(state)) {
        part.cuts += condition->kind == CuttingCondition::Kind::cut;
        part.air += condition->kind == CuttingCondition::Kind::air;
        streams.condition(*condition);
      }
    }
    if (set_up.from_memory) {
      if (!started && state.connected) {
        startFromMemory(world.controller(), text);
        started = true;
        part.time = -now;
      }
      if (state.alarm) throw Error("program: " + state.alarm_text);
      const bool runs = state.run == CncRun::start;
      if (started && std::exchange(running, runs) && !runs) {
        part.time += now;
        part.lost = follower.status().lost;
        return part;
      }
      continue;
    }
    if (!started && state.connected && !state.armed) {
      const auto answer = bridge.arm(true);
      if (answer.code != cnc::ArmCode::ok) throw Error("arm: " + answer.message);
    } else if (!started && state.armed) {
      if (const auto refusal = bridge.runProgram("pocket", text, CuttingCondition()))
        throw Error("program: " + refusal->message);
      started = true;
      part.time = -now;
    }
    if (const auto outcome = bridge.takeOutcome()) {
      if (outcome->code != cnc::MotionCode::ok) throw Error("program: " + outcome->message);
      part.time += now;
      part.lost = follower.status().lost;
      return part;
    }
  }
  throw Error("program: it has not ended");
}

}  // namespace smartmill
