// rosrun smartmill_cnc capture HOST: a session with a controller, decoded line by line and written to a file.

#include <atomic>
#include <chrono>
#include <csignal>
#include <cstdio>
#include <fstream>
#include <string>
#include <thread>

#include "smartmill_core/error.h"
#include "smartmill_core/program.h"
#include "smartmill_focas/recording.h"

namespace {

using namespace smartmill;

volatile std::sig_atomic_t stop_requested = 0;

extern "C" void requestStop(int) {
  stop_requested = 1;
}

/// Who is asked stands behind the tap: messages name him.
std::string inPlaceOf(const std::string& tap, const std::string& there, std::string message) {
  const std::size_t at = message.find(tap);
  return at == std::string::npos ? message : message.replace(at, tap.size(), there);
}

}  // namespace

int main(int argc, char** argv) {
  std::string host, file = "session.focas";
  int port = focas::DEFAULT_PORT, listen_port = 0;
  double timeout = 2.0;
  CommandLine line{
      "Records a session with a Fanuc controller (FOCAS2 Ethernet) and prints it decoded, one line a request "
      "and "
      "reply. By itself it asks for all that can be read and writes nothing to the controller; with --listen "
      "it "
      "stands between any client and the controller until Ctrl-C."};
  line.option("HOST", host, "the controller's name or address").required();
  line.option("--port", port, "its FOCAS port").within(1, 65535).showDefault();
  line.option("--listen", listen_port, "port of loopback for other clients; 0: asks by itself")
      .within(0, 65535);
  line.option("--timeout", timeout, "[s] for connecting and for every answer").positive().showDefault();
  line.option("-o,--out", file, "file to write (smartmill-focas-session/1)").showDefault();
  return runProgram(line, argc, argv, [&] {
    std::ofstream out(file);
    if (!out) {
      throw Error(file + ": cannot be written");
    }
    focas::beginRecording(out);
    std::atomic<bool> heard{false};  // a frame of the controller's
    const auto tell = [&](const focas::RecordedFrame& frame) {
      heard = heard || !frame.from_client;
      focas::append(out, frame);
      std::printf("%s\n", focas::describe(frame).c_str());
      std::fflush(stdout);
    };
    std::signal(SIGINT, requestStop);
    std::signal(SIGTERM, requestStop);
    const focas::Tap tap(static_cast<std::uint16_t>(listen_port), host, static_cast<std::uint16_t>(port),
                         timeout, tell);
    if (listen_port == 0) {
      try {
        focas::Client client;
        client.connect("127.0.0.1", tap.port(), timeout);
        focas::askEverything(client);
        client.close();
      } catch (const focas::FocasError& e) {
        const std::string there = host + ":" + std::to_string(port);
        const std::string why = inPlaceOf("127.0.0.1:" + std::to_string(tap.port()), there, e.what());
        throw Error(heard ? why : there + " does not answer as a controller: " + why);
      }
    }
    while (listen_port != 0 && stop_requested == 0) {
      std::this_thread::sleep_for(std::chrono::milliseconds(50));
    }
    out.flush();
    if (!out) {
      throw Error(file + ": cannot be written");
    }
  });
}
