// rosrun smartmill_cnc linuxcnc_panel FOLDER COMMAND: the operator's panel of a LinuxCNC.

#include <chrono>
#include <cstdio>
#include <fstream>
#include <map>
#include <string>
#include <thread>
#include <vector>

#include <ros/init.h>

#include "smartmill_cnc/linuxcnc/gateway_client.h"
#include "smartmill_core/program.h"

namespace {

using namespace smartmill;
using namespace smartmill::cnc::linuxcnc;

void show(const MachineStatus& s) {
  const char* states[] = {"", "emergency stop", "reset", "off", "on"};
  const char* modes[] = {"", "manual", "automatic", "mdi"};
  std::printf("%s, %s, %s%s%s, x %.4f y %.4f z %.4f mm, %.1f mm/min%s%s\n", s.alive ? "alive" : "not running",
              states[static_cast<int>(s.state)], modes[static_cast<int>(s.mode)], s.homed ? ", homed" : "",
              s.held   ? ", feed hold"
              : s.busy ? ", busy"
                       : "",
              1e3 * s.position[0], 1e3 * s.position[1], 1e3 * s.position[2], 6e4 * s.velocity,
              s.errors.empty() ? "" : ", ", s.errors.c_str());
}

/// A program of a file without its frame: the gateway runs it as a subroutine, which ends itself.
std::string programOf(const std::string& file) {
  std::ifstream in(file);
  if (!in) throw Error(file + ": cannot be read");
  std::string text;
  for (std::string line; std::getline(in, line);) {
    const bool ends = line.find("M30") != std::string::npos || line.find("M2") == 0;
    if (!line.empty() && line[0] != '%' && !ends) text += line + "\n";
  }
  return text;
}

/// Runs a program to its end. The gateway stops the machine when its client disconnects before.
void runProgramOf(GatewayClient& client, const std::string& file) {
  constexpr std::chrono::milliseconds PERIOD(100);
  client.connect();
  const std::string program = programOf(file);
  const int number = client.status().running + 1;
  for (const Command& command :
       {Command{CommandCode::open, 0, 0.0, {}}, Command{CommandCode::run, number, 0.0, program}}) {
    const Reply reply = client.carryOut(command);
    if (reply.code != Reply::Code::done) throw Error(reply.text);
  }
  MachineStatus status = client.status();
  for (; status.alive && status.errors.empty() && status.done != number; status = client.status())
    std::this_thread::sleep_for(PERIOD);
  if (!status.errors.empty()) throw Error(file + ": " + status.errors);
}

/// Executes a command (null: reads the status). Retries failures until the timeout, since the controller may
/// still be starting. @param timeout [s]
MachineStatus carryOut(GatewayClient& client, const CommandCode* command, double timeout) {
  const auto end = std::chrono::steady_clock::now() + std::chrono::duration<double>(timeout);
  for (;;) {
    try {
      client.connect();
      if (command) {
        const Reply reply = client.carryOut({*command, 0, 0.0, {}});
        if (reply.code != Reply::Code::done) {
          throw Error(reply.text);
        }
      }
      return client.status();
    } catch (const Error&) {
      if (std::chrono::steady_clock::now() > end) {
        throw;
      }
    }
    std::this_thread::sleep_for(std::chrono::milliseconds(50));
  }
}

}  // namespace

int main(int argc, char** argv) {
  const std::map<std::string, CommandCode> codes{{"ready", CommandCode::ready},
                                                 {"estop", CommandCode::estop},
                                                 {"hold", CommandCode::hold},
                                                 {"resume", CommandCode::resume},
                                                 {"abort", CommandCode::abort}};
  std::string folder, command, program;
  double timeout = 0.0;
  const double reply_timeout = 8.0;  // [s] of the gateway, including homing
  CommandLine line{"The operator's panel of a LinuxCNC with linuxcnc_gateway."};
  line.option("folder", folder, "folder of the machine").required();
  line.option("command", command,
              "ready: resets emergency stop and errors, switches on, homes; estop; hold; resume; abort; run: "
              "runs the program of --program and waits for its end (an interrupt stops the machine); show: "
              "prints the status")
      .required()
      .oneOf({"ready", "estop", "hold", "resume", "abort", "run", "show"});
  line.option("--program", program, "NC program in the dialect of LinuxCNC, for run").existingFile();
  line.option("--wait", timeout, "[s] timeout for the controller to start").notNegative().showDefault();
  std::vector<std::string> own_arguments;  // without those of roslaunch
  ros::removeROSArgs(argc, argv, own_arguments);
  std::vector<const char*> arguments;
  for (const std::string& argument : own_arguments) {
    arguments.push_back(argument.c_str());
  }
  return runProgram(line, static_cast<int>(arguments.size()), arguments.data(), [&] {
    GatewayClient client(folder, reply_timeout);
    if ((command == "run") == program.empty())
      throw UsageError("--program: expected with run, and only then");
    if (command == "run") runProgramOf(client, program);
    const auto code = codes.find(command);
    show(carryOut(client, code == codes.end() ? nullptr : &code->second, timeout));
  });
}
