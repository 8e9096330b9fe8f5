// rosrun smartmill_sim controller: the simulated controller on its own, in wall-clock time, without a ROS
// master.

#include <chrono>
#include <csignal>
#include <cstdint>
#include <cstdio>
#include <map>
#include <string>
#include <thread>
#include <vector>

#include "smartmill_core/model/machine_model.h"
#include "smartmill_core/program.h"
#include "smartmill_focas/server.h"
#include "smartmill_sim/controller/controller.h"

namespace {

using namespace smartmill;
using Clock = std::chrono::steady_clock;

constexpr double STEP = 1e-3;  // [s]
constexpr double MOST_BEHIND =
    0.5;  // [s] after a longer pause of the computer the machine goes on where it was

volatile std::sig_atomic_t stop_requested = 0;

extern "C" void requestStop(int) {
  stop_requested = 1;
}

void run(sim::Controller& controller) {
  std::vector<sim::MotionState> states;
  Clock::time_point done = Clock::now();
  while (stop_requested == 0) {
    std::this_thread::sleep_for(std::chrono::milliseconds(2));
    const Clock::time_point now = Clock::now();
    if (std::chrono::duration<double>(now - done).count() > MOST_BEHIND) {
      done = now;
    }
    const auto count = static_cast<std::size_t>(std::chrono::duration<double>(now - done).count() / STEP);
    controller.advance(STEP, count, states);
    done += std::chrono::milliseconds(1) * count;
  }
}

}  // namespace

int main(int argc, char** argv) {
  const std::map<std::string, int> modes{{"mdi", focas::AUT_MDI},       {"mem", focas::AUT_MEM},
                                         {"edit", focas::AUT_EDIT},     {"handle", focas::AUT_HANDLE},
                                         {"jog", focas::AUT_JOG},       {"inc", focas::AUT_INC},
                                         {"reference", focas::AUT_REF}, {"dnc", focas::AUT_REMOTE}};
  std::string mode = "dnc", model_file, type = "30";
  focas::ServerOptions server_options;
  CommandLine line{
      "Simulated Fanuc controller of a three-axis mill: FOCAS2 over Ethernet, in wall-clock time, until "
      "Ctrl-C.\n"
      "Without a model: travel x -250..250, y -200..200, z -300..0 mm, start at 0 0 0, rapid 30 m/min, 5 "
      "m/s2,\n"
      "spindle to 20000 rpm at 10000 rpm/s."};
  line.option("--port", server_options.port, "TCP port, 0: any free one").showDefault();
  line.option("--bind", server_options.bind_address, "address to listen on").showDefault();
  line.option("--mode", mode,
              "at the panel: mdi, mem, edit, handle, jog, inc, reference, dnc (the one that runs programs)")
      .oneOf({"mdi", "mem", "edit", "handle", "jog", "inc", "reference", "dnc"})
      .showDefault();
  line.option("--type", type, "which control it says it is").oneOf({"30", "31"}).showDefault();
  line.option("--model", model_file, "machine model file: its sections axes and spindle");
  return runProgram(line, argc, argv, [&] {
    std::signal(SIGINT, requestStop);
    std::signal(SIGTERM, requestStop);
    sim::ControllerOptions options =
        sim::ControllerOptions::ofModel(model_file.empty() ? MachineModel{} : readMachineModel(model_file));
    options.mode = modes.at(mode);
    options.info.cnc_type = type;
    sim::Controller controller(options);
    const focas::Server server(server_options, controller);
    std::printf("controller: listens on %s:%d, mode %s\n", server_options.bind_address.c_str(), server.port(),
                mode.c_str());
    std::fflush(stdout);
    run(controller);
  });
}
