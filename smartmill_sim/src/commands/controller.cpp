#include "smartmill_sim/commands.h"

#include <chrono>
#include <cstdint>
#include <cstdio>
#include <map>
#include <string>
#include <thread>
#include <vector>

#include "smartmill_core/model/machine_model.h"
#include "smartmill_core/stop_signal.h"
#include "smartmill_focas/server.h"
#include "smartmill_sim/controller/controller.h"

namespace {

using namespace smartmill;
using Clock = std::chrono::steady_clock;

const std::map<std::string, int> MODES{{"mdi", focas::AUT_MDI},       {"mem", focas::AUT_MEM},
                                       {"edit", focas::AUT_EDIT},     {"handle", focas::AUT_HANDLE},
                                       {"jog", focas::AUT_JOG},       {"inc", focas::AUT_INC},
                                       {"reference", focas::AUT_REF}, {"dnc", focas::AUT_REMOTE}};

struct Arguments {
  std::string mode = "dnc", model, type = "30";
  focas::ServerOptions server;
  const std::chrono::milliseconds step{1};  // of the machine
  const double most_behind = 0.5;  // [s] after a longer pause of the computer the elapsed time is skipped
};

void run(const Arguments& a, sim::Controller& controller) {
  std::vector<sim::MotionState> states;
  Clock::time_point done = Clock::now();
  while (!stopRequested()) {
    std::this_thread::sleep_for(std::chrono::milliseconds(2));
    const Clock::time_point now = Clock::now();
    if (std::chrono::duration<double>(now - done).count() > a.most_behind) {
      done = now;
    }
    const auto count = static_cast<std::size_t>((now - done) / a.step);
    controller.advance(std::chrono::duration<double>(a.step).count(), count, states);
    done += a.step * count;
  }
}

void run(const Arguments& a) {
  catchStopSignals();
  sim::ControllerOptions options =
      sim::ControllerOptions::ofModel(a.model.empty() ? MachineModel{} : readMachineModel(a.model));
  options.mode = MODES.at(a.mode);
  options.info.cnc_type = a.type;
  sim::Controller controller(options);
  const focas::Server server(a.server, controller.calls());
  std::printf("controller: listens on %s:%d, mode %s\n", a.server.bind_address.c_str(), server.port(),
              a.mode.c_str());
  std::fflush(stdout);
  run(a, controller);
}

}  // namespace

namespace smartmill::sim {

Command controllerCommand() {
  Command command("controller", "runs the simulated Fanuc controller until Ctrl-C");
  command.description =
      "Simulated Fanuc controller of a three-axis mill: FOCAS2 over Ethernet, in wall-clock time, until "
      "Ctrl-C.\n"
      "Defaults without a model: travel x -250..250, y -200..200, z -300..0 mm, start at 0 0 0, rapid 30 "
      "m/min, 5 "
      "m/s2,\n"
      "spindle to 20000 rpm at 10000 rpm/s.";
  command.examples = {{"--port 8193 --mode dnc", "listens on loopback; clients may run programs"},
                      {"--port 0 --model mill.yaml", "any free port; axes and spindle of a model"}};
  command.files = {{"MODEL", "machine model file: its sections axes and spindle"}};
  command.exits = {{0, "stopped by Ctrl-C or SIGTERM"}};
  command.setBody(run, [](CommandLine& line, Arguments& a) {
    std::vector<std::string> modes;
    for (const auto& [name, code] : MODES) modes.push_back(name);
    line.option("--port", a.server.port, "TCP port, 0: any free one").showDefault();
    line.option("--bind", a.server.bind_address, "address to listen on").showDefault();
    line.option("--mode", a.mode,
                "mode at the panel: mdi, mem, edit, handle, jog, inc, reference, dnc (the one that runs "
                "programs)")
        .oneOf(modes)
        .showDefault();
    line.option("--type", a.type, "control type that it reports").oneOf({"30", "31"}).showDefault();
    line.option("--model", a.model, "machine model file: its sections axes and spindle");
  });
  return command;
}

}  // namespace smartmill::sim
