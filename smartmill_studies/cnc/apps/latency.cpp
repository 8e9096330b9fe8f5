// rosrun smartmill_studies cnc_latency: latency of requests to a controller on loopback, number of
// simultaneous sessions and cost of polling, for the simulated Fanuc or a running LinuxCNC
// (linuxcnc_machine).

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cstdio>
#include <ctime>
#include <functional>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "smartmill_cnc/controller/focas_controller.h"
#include "smartmill_cnc/linuxcnc/gateway_client.h"
#include "smartmill_cnc/linuxcnc/linuxcnc_controller.h"
#include "smartmill_cnc/linuxcnc/local_socket.h"
#include "smartmill_cnc/linuxcnc/servo_stream.h"
#include "smartmill_core/error.h"
#include "smartmill_core/io/process_usage.h"
#include "smartmill_core/program.h"
#include "smartmill_focas/client.h"
#include "smartmill_focas/server.h"
#include "smartmill_sim/controller/controller.h"

namespace {

using namespace smartmill;
using Clock = std::chrono::steady_clock;

constexpr double RATE = 50.0;  // [Hz]

double processSeconds() {
  std::timespec now{};
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

template <class Ask>
void timed(const char* name, int count, const Ask& ask) {
  std::vector<double> durations;
  for (int i = 0; i < count; ++i) {
    const Clock::time_point before = Clock::now();
    ask();
    durations.push_back(std::chrono::duration<double>(Clock::now() - before).count());
  }
  std::sort(durations.begin(), durations.end());
  std::printf("%-28s median %.3f ms, 99 %% %.3f ms, longest %.3f ms (%d)\n", name,
              1e3 * durations[durations.size() / 2], 1e3 * durations[durations.size() * 99 / 100],
              1e3 * durations.back(), count);
}

/// Complete read cycles of the bridge at its rate: duration, and CPU load of both sides as share of one core.
/// @param used [s] CPU time of both sides
void polled(cnc::Controller& controller, double seconds, const std::function<double()>& used) {
  const double cpu = used();
  const Clock::time_point began = Clock::now();
  std::vector<double> durations;
  for (int i = 0; i < static_cast<int>(seconds * RATE); ++i) {
    std::this_thread::sleep_until(began + std::chrono::duration_cast<Clock::duration>(
                                              std::chrono::duration<double>(static_cast<double>(i) / RATE)));
    const Clock::time_point before = Clock::now();
    if (!controller.read()) {
      throw Error("a read cycle failed");
    }
    durations.push_back(std::chrono::duration<double>(Clock::now() - before).count());
  }
  std::sort(durations.begin(), durations.end());
  std::printf("read cycle at %.0f Hz          median %.3f ms, 99 %% %.3f ms; %.2f %% of a core, both sides\n",
              RATE, 1e3 * durations[durations.size() / 2], 1e3 * durations[durations.size() * 99 / 100],
              100.0 * (used() - cpu) / seconds);
}

int sessions(std::uint16_t port) {
  std::vector<std::unique_ptr<focas::Client>> clients;
  for (;;) {
    clients.push_back(std::make_unique<focas::Client>());
    try {
      clients.back()->connect("127.0.0.1", port, 2.0);
      clients.back()->statusInfo();
    } catch (const focas::FocasError&) {
      return static_cast<int>(clients.size()) - 1;
    }
  }
}

/// The simulated Fanuc on a free port.
void measureFanuc(int count, double seconds) {
  sim::Controller machine(sim::ControllerOptions::ofModel(MachineModel{}));
  focas::ServerOptions options;
  options.port = 0;
  focas::Server server(options, machine.calls());
  focas::Client client;
  client.connect("127.0.0.1", server.port(), 2.0);
  timed("cnc_acts", count, [&] { client.actualSpeed(); });
  timed("cnc_statinfo (3 requests)", count, [&] { client.statusInfo(); });
  timed("cnc_rdspmeter (5 requests)", count, [&] { client.spindleMeter(); });
  client.close();
  std::printf("simultaneous sessions: %d\n", sessions(server.port()));
  cnc::FocasParameters parameters;
  parameters.port = server.port();
  const std::unique_ptr<cnc::Controller> controller = cnc::makeFocasController(parameters);
  const Clock::time_point until = Clock::now() + std::chrono::seconds(5);
  while (!controller->connect() && Clock::now() < until) {
    std::this_thread::sleep_for(std::chrono::milliseconds(10));  // until the sessions above are closed
  }
  timed("read cycle of the bridge", count, [&] {
    if (!controller->read()) throw Error("a read cycle failed");
  });
  polled(*controller, seconds, processSeconds);
}

double steadySeconds() {
  return std::chrono::duration<double>(Clock::now().time_since_epoch()).count();
}

int gatewaySessions(const std::string& folder) {
  std::vector<std::unique_ptr<cnc::linuxcnc::GatewayClient>> clients;
  for (;;) {
    clients.push_back(std::make_unique<cnc::linuxcnc::GatewayClient>(folder, 2.0));
    try {
      clients.back()->connect();
      clients.back()->status();
    } catch (const Error&) {
      return static_cast<int>(clients.size()) - 1;
    }
  }
}

/// A LinuxCNC that is ready, by the folder of its sockets.
void measureLinuxCnc(const std::string& folder, int count, double seconds) {
  using namespace cnc::linuxcnc;
  const int gateway = LocalConnection::to(folder + "/" + GATEWAY_SOCKET).peer();
  const int reader = LocalConnection::to(folder + "/" + STREAM_SOCKET).peer();
  std::printf("simultaneous sessions, in addition to linuxcnc_stream: %d\n", gatewaySessions(folder));
  std::this_thread::sleep_for(std::chrono::milliseconds(100));  // until they are closed
  {
    GatewayClient client(folder, 2.0);
    client.connect();
    timed("status", count, [&] { client.status(); });
  }
  const auto stream = std::make_shared<ServoStream>(folder);
  std::atomic<bool> over{false};
  std::thread listener([&] {
    while (!over) stream->step(0.05, steadySeconds);
  });
  const auto end = [&] {
    over = true;
    listener.join();
  };
  try {
    const std::unique_ptr<cnc::Controller> controller =
        makeLinuxCncController({folder, 2.0}, stream, steadySeconds);
    std::this_thread::sleep_for(std::chrono::milliseconds(500));
    const auto connected = controller->connect();
    if (!connected) throw Error(connected.failure().message);
    timed("read cycle of the bridge", count, [&] {
      if (!controller->read()) throw Error("a read cycle failed");
    });
    polled(*controller, seconds,
           [&] { return processSeconds() + processUsage(gateway).cpu_time + processUsage(reader).cpu_time; });
  } catch (...) {
    end();
    throw;
  }
  end();
}

}  // namespace

int main(int argc, char** argv) {
  int count = 5000;
  double seconds = 20.0;
  std::string folder;
  CommandLine line{"Latency of a controller on loopback, number of sessions, and cost of polling at 50 Hz."};
  line.option("--count", count, "requests of each kind").positive().showDefault();
  line.option("--seconds", seconds, "[s] of polling").positive().showDefault();
  line.option("--linuxcnc", folder,
              "socket folder of a linuxcnc_machine that is ready; it is measured instead");
  return runProgram(line, argc, argv, [&] {
    if (folder.empty()) {
      measureFanuc(count, seconds);
    } else {
      measureLinuxCnc(folder, count, seconds);
    }
  });
}
