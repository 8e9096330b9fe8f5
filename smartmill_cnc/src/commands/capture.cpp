#include "smartmill_cnc/commands.h"

#include <atomic>
#include <chrono>
#include <cstdio>
#include <fstream>
#include <string>
#include <thread>

#include "smartmill_core/error.h"
#include "smartmill_core/stop_signal.h"
#include "smartmill_focas/recording.h"

namespace {

using namespace smartmill;

struct Arguments {
  std::string host, file = "session.focas";
  int port = focas::DEFAULT_PORT, listen_port = 0;
  double timeout = 2.0;
};

/// Replaces the address of the relaying tap by that of the controller.
std::string withAddress(const std::string& tap, const std::string& controller, std::string message) {
  const std::size_t at = message.find(tap);
  return at == std::string::npos ? message : message.replace(at, tap.size(), controller);
}

void run(const Arguments& a) {
  std::ofstream out(a.file);
  if (!out) throw Error(a.file + ": cannot be written");
  focas::beginRecording(out);
  std::atomic<bool> replied{false};  // the controller has sent a frame
  const auto record = [&](const focas::RecordedFrame& frame) {
    replied = replied || !frame.from_client;
    focas::append(out, frame);
    std::printf("%s\n", focas::describe(frame).c_str());
    std::fflush(stdout);
  };
  catchStopSignals();
  const focas::Tap tap(static_cast<std::uint16_t>(a.listen_port), a.host, static_cast<std::uint16_t>(a.port),
                       a.timeout, record);
  if (a.listen_port == 0) {
    try {
      focas::Client client;
      client.connect("127.0.0.1", tap.port(), a.timeout);
      focas::askEverything(client);
      client.close();
    } catch (const focas::FocasError& e) {
      const std::string controller = a.host + ":" + std::to_string(a.port);
      const std::string why = withAddress("127.0.0.1:" + std::to_string(tap.port()), controller, e.what());
      throw Error(replied ? why : controller + " does not answer as a controller: " + why);
    }
  }
  while (a.listen_port != 0 && !stopRequested()) {
    std::this_thread::sleep_for(std::chrono::milliseconds(50));
  }
  out.flush();
  if (!out) throw Error(a.file + ": cannot be written");
}

}  // namespace

namespace smartmill::cnc {

Command captureCommand() {
  Command command("capture", "records a session with a Fanuc controller and prints it decoded");
  command.description =
      "Records a session with a Fanuc controller (FOCAS2 Ethernet) and prints it decoded, one line per "
      "request "
      "and reply. Without --listen it requests all readable values and writes nothing to the controller; "
      "with "
      "--listen it relays between any client and the controller until Ctrl-C.";
  command.examples = {
      {"192.168.1.10 -o machine.focas", "all readable values of a controller"},
      {"192.168.1.10 --listen 8194", "relays the session of a client that connects to port 8194"}};
  command.files = {{"OUT", "the session, frame by frame (smartmill-focas-session/1)"}};
  command.exits = {{0, "done; with --listen: stopped by Ctrl-C or SIGTERM"}};
  command.setBody(run, [](CommandLine& line, Arguments& a) {
    line.option("HOST", a.host, "name or address of the controller").required();
    line.option("--port", a.port, "FOCAS port of the controller").within(1, 65535).showDefault();
    line.option("--listen", a.listen_port,
                "port on loopback for another client; 0: requests all values itself")
        .within(0, 65535)
        .showDefault();
    line.option("--timeout", a.timeout, "[s] timeout of connecting and of every reply")
        .positive()
        .showDefault();
    line.option("-o,--out", a.file, "file to write (smartmill-focas-session/1)").showDefault();
  });
  return command;
}

}  // namespace smartmill::cnc
