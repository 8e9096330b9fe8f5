// rosrun smartmill_cnc linuxcnc_panel FOLDER WORD: what an operator does at the panel of a LinuxCNC.

#include <chrono>
#include <cstdio>
#include <map>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include <ros/init.h>

#include "smartmill_cnc/linuxcnc/gateway_client.h"
#include "smartmill_core/program.h"

namespace {

using namespace smartmill;
using namespace smartmill::cnc::linuxcnc;

constexpr double ANSWER = 8.0;  // [s] homing included

void show(const MachineStatus& s) {
  const char* states[] = {"", "emergency stop", "reset", "off", "on"};
  const char* modes[] = {"", "manual", "automatic", "mdi"};
  std::printf("%s, %s, %s%s%s, x %.4f y %.4f z %.4f mm, %.1f mm/min%s%s\n", s.alive ? "alive" : "gone",
              states[static_cast<int>(s.state)], modes[static_cast<int>(s.mode)], s.homed ? ", homed" : "",
              s.held   ? ", feed hold"
              : s.busy ? ", busy"
                       : "",
              1e3 * s.position[0], 1e3 * s.position[1], 1e3 * s.position[2], 6e4 * s.velocity,
              s.errors.empty() ? "" : ", ", s.errors.c_str());
}

/// One word; what does not come about is tried again while there is patience: everything may just be
/// starting.
MachineStatus carryOut(GatewayClient& client, const std::optional<Word>& word, double patience) {
  const auto end = std::chrono::steady_clock::now() + std::chrono::duration<double>(patience);
  for (;;) {
    try {
      client.connect();
      if (word) {
        const Reply reply = client.carryOut({*word, 0, 0.0, {}});
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
  const std::map<std::string, Word> words{{"ready", Word::ready},
                                          {"estop", Word::estop},
                                          {"hold", Word::hold},
                                          {"resume", Word::resume},
                                          {"abort", Word::abort}};
  std::string folder, word;
  double patience = 0.0;
  CommandLine line{"The panel of a LinuxCNC behind linuxcnc_gateway."};
  line.option("folder", folder, "of the machine").required();
  line.option(
          "word", word,
          "ready: resets the emergency stop and errors, switches on, homes; estop, hold, resume, abort; show")
      .required()
      .oneOf({"ready", "estop", "hold", "resume", "abort", "show"});
  line.option("--wait", patience, "[s] for the controller to be there").notNegative().showDefault();
  std::vector<std::string> due;  // without those of roslaunch
  ros::removeROSArgs(argc, argv, due);
  std::vector<const char*> arguments;
  for (const std::string& argument : due) {
    arguments.push_back(argument.c_str());
  }
  return runProgram(line, static_cast<int>(arguments.size()), arguments.data(), [&] {
    GatewayClient client(folder, ANSWER);
    show(carryOut(client, word == "show" ? std::nullopt : std::optional<Word>(words.at(word)), patience));
  });
}
