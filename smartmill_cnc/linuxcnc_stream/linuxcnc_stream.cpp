// Reads LinuxCNC's servo cycles from a HAL sampler and publishes them on a local socket; writes the spindle
// load, the overrides and the permit of motion. A separate process, because the end of LinuxCNC ends every
// HAL component.

#include <hal.h>
#include <poll.h>
#include <rtapi.h>
#include <sys/shm.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <iostream>
#include <list>
#include <memory>
#include <thread>

#include "smartmill_cnc/linuxcnc/configuration.h"
#include "smartmill_cnc/linuxcnc/liveness.h"
#include "smartmill_cnc/linuxcnc/local_socket.h"
#include "smartmill_cnc/linuxcnc/silence_timer.h"
#include "smartmill_core/error.h"
#include "smartmill_core/program.h"
#include "smartmill_core/stop_signal.h"
#include "smartmill_core/units.h"

namespace smartmill::cnc::linuxcnc {
namespace {

using Clock = std::chrono::steady_clock;

constexpr int HAL_SEGMENT = 0x48414c32, SAMPLER_FIFO = 0x48534130;  // keys fixed in LinuxCNC's sources
constexpr int CONTROLLER_ENDED = 3;                                 // exit code

struct StreamOptions {
  int read_period = 3;  ///< [ms] a block has a few samples, the delay stays small
  std::chrono::milliseconds request_period{
      30};                                      ///< of the gateway's status: far below LivenessOptions::hangs
  std::chrono::milliseconds retry_period{100};  ///< between two attempts to connect
  std::chrono::milliseconds loading_time{10000};  ///< in which a controller loads its configuration
  double silence_timeout = 0.5;  ///< [s] without samples after which the controller has ended
};

double seconds() {
  return std::chrono::duration<double>(Clock::now().time_since_epoch()).count();
}

/// This process as a HAL component. Its pins are bidirectional, so that signals still linked to an ended
/// process do not block the next one.
class Component {
 public:
  Component() : prefix_("smartmill-" + std::to_string(::getpid())), id_(::hal_init(prefix_.c_str())) {
    if (id_ < 0) {
      throw Error("cannot create a HAL component (code " + std::to_string(id_) + ")");
    }
    pins_ = static_cast<Pins*>(::hal_malloc(sizeof(Pins)));
    const bool made =
        pins_ && ::hal_pin_bit_new((prefix_ + ".permit").c_str(), HAL_IO, &pins_->permit, id_) == 0 &&
        ::hal_pin_bit_new((prefix_ + ".beat").c_str(), HAL_IO, &pins_->beat, id_) == 0 &&
        ::hal_pin_float_new((prefix_ + ".load").c_str(), HAL_IO, &pins_->load, id_) == 0 &&
        ::hal_pin_float_new((prefix_ + ".feed-override").c_str(), HAL_IO, &pins_->feed, id_) == 0 &&
        ::hal_pin_float_new((prefix_ + ".spindle-override").c_str(), HAL_IO, &pins_->spindle, id_) == 0;
    ::hal_ready(id_);
    if (!made || ::hal_link((prefix_ + ".permit").c_str(), PERMIT_SIGNAL) != 0 ||
        ::hal_link((prefix_ + ".beat").c_str(), BEAT_SIGNAL) != 0) {
      ::hal_exit(id_);
      throw Error("the controller's configuration has no signals '" + std::string(PERMIT_SIGNAL) + "' and '" +
                  BEAT_SIGNAL + "'");
    }
    // The link fails if the drive writes the signal itself.
    has_load_signal_ = ::hal_link((prefix_ + ".load").c_str(), LOAD_SIGNAL) == 0;
    has_override_signals_ = ::hal_link((prefix_ + ".feed-override").c_str(), FEED_SIGNAL) == 0 &&
                            ::hal_link((prefix_ + ".spindle-override").c_str(), SPINDLE_SIGNAL) == 0;
    setOverrides({});
    if (::hal_stream_attach(&stream_, id_, SAMPLER_FIFO, SAMPLER_PINS) < 0) {
      ::hal_exit(id_);
      throw Error("the controller's configuration has no sampler '" + std::string(SAMPLER_PINS) + "'");
    }
    // Discards stale samples: a full FIFO drops the newest.
    unsigned number = 0;
    hal_stream_data data[HAL_STREAM_MAX_PINS];
    while (::hal_stream_readable(&stream_) && ::hal_stream_read(&stream_, data, &number) >= 0) {
    }
  }
  ~Component() {
    *pins_->permit = false;
    ::hal_stream_detach(&stream_);
    ::hal_exit(id_);
  }
  Component(const Component&) = delete;
  Component& operator=(const Component&) = delete;

  /// All available samples up to the next gap.
  ServoBlock read() {
    ServoBlock block;
    while (block.samples.size() < ServoBlock::MOST) {
      if (!sample_pending_ && !readOne()) {
        break;
      }
      if (block.samples.empty()) {
        block.first = number_;
      } else if (number_ != block.first + block.samples.size()) {
        break;
      }
      block.samples.push_back(sample_);
      sample_pending_ = false;
    }
    return block;
  }

  void permit(bool on) {
    *pins_->permit = on;
    *pins_->beat = !*pins_->beat;
  }
  /// The feed override is at most 1 (motion.adaptive-feed). @return refused without the signals
  Reply setOverrides(const SetOverrides& wanted) {
    if (!has_override_signals_) {
      return {Reply::Code::refused, std::string("the controller's configuration has no signals '") +
                                        FEED_SIGNAL + "' and '" + SPINDLE_SIGNAL + "'"};
    }
    *pins_->feed = std::clamp(wanted.feed, 0.0, 1.0);
    *pins_->spindle = std::max(0.0, wanted.spindle);
    return {};
  }
  void setLoad(double load) {
    if (has_load_signal_) {
      *pins_->load = load;
    }
  }

 private:
  struct Pins {
    hal_bit_t *permit, *beat;
    hal_float_t *load, *feed, *spindle;
  };

  bool readOne() {
    hal_stream_data d[HAL_STREAM_MAX_PINS];
    unsigned number = 0;
    if (!::hal_stream_readable(&stream_) || ::hal_stream_read(&stream_, d, &number) < 0) {
      return false;
    }
    number_ = number;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      sample_.position[axis] = d[axis].f * units::MM;
    }
    sample_.revolutions = d[3].f;
    sample_.spindle_speed = units::radPerSecFromRpm(d[4].f);
    sample_.velocity = d[5].f * units::MM;
    sample_.distance_to_go = d[6].f * units::MM;
    sample_.spindle_load = d[7].f;
    sample_.marker = d[8].f;
    sample_.tool = d[9].s;
    return sample_pending_ = true;
  }

  const std::string prefix_;
  const int id_;
  Pins* pins_ = nullptr;
  bool has_load_signal_ = false, has_override_signals_ = false;
  hal_stream_t stream_{};
  bool sample_pending_ = false;  // a sample is read but not yet returned
  std::uint32_t number_ = 0;
  ServoSample sample_;
};

/// Monitors the gateway and, through it, the controller's task: motion is permitted only while both are
/// alive.
class GatewayWatch {
 public:
  explicit GatewayWatch(std::string path) : path_(std::move(path)) {}

  bool alive() {
    const Clock::time_point now = Clock::now();
    if (!gateway_.open() && now - last_attempt_ > options_.retry_period) {
      last_attempt_ = now;
      try {
        gateway_ = LocalConnection::to(path_);
        process_.watch(gateway_.peer());
        liveness_ = Liveness();
        gateway_.send(Command{CommandCode::guard, 0, 0.0, {}});
      } catch (const Error&) {
      }
    }
    gateway_.receive();
    bool updated = false;
    while (const std::optional<Received> received = gateway_.next()) {
      if (const auto* status = std::get_if<MachineStatus>(&received->message)) {
        updated = alive_ = status->alive;
        starved_ = status->starved > 0.0;
      }
    }
    const Liveness::Verdict verdict = liveness_.update(updated, process_, seconds());
    if (now - last_request_ > options_.request_period) {
      last_request_ = now;
      gateway_.send(StatusRequest{});
    }
    return gateway_.open() && alive_ && verdict == Liveness::Verdict::lives;
  }

  /// Whether the controller is silent because it waits for a processor.
  bool starved() const { return starved_; }

 private:
  const std::string path_;
  const StreamOptions options_;
  LocalConnection gateway_;
  Clock::time_point last_attempt_, last_request_;
  bool alive_ = false, starved_ = false;
  ProcessWatch process_;
  Liveness liveness_;
};

class Server {
 public:
  explicit Server(const std::string& folder)
      : listener_(listenAt(folder + "/" + STREAM_SOCKET)), watch_(folder + "/" + GATEWAY_SOCKET) {}

  /// Waits for a controller with loaded configuration; null if the process is to end.
  std::unique_ptr<Component> component() const {
    Clock::time_point found = Clock::now();
    while (!stopRequested()) {
      // hal_init() would create a missing segment with the wrong owner.
      if (::shmget(HAL_SEGMENT, 0, 0) < 0) {
        found = Clock::now();
      } else {
        try {
          return std::make_unique<Component>();
        } catch (const Error&) {
          if (Clock::now() - found > options_.loading_time) throw;
        }
      }
      std::this_thread::sleep_for(options_.retry_period);
    }
    return nullptr;
  }

  /// @return the exit code
  int serve(Component& component) {
    SilenceTimer silence;
    while (!stopRequested()) {
      pollfd entry{listener_.get(), POLLIN, 0};
      ::poll(&entry, 1, options_.read_period);
      if (std::optional<LocalConnection> connection = acceptFrom(listener_)) {
        clients_.push_back(std::move(*connection));
      }
      component.permit(watch_.alive());
      bool heard = false;
      for (ServoBlock block = component.read(); !block.samples.empty(); block = component.read()) {
        heard = true;
        for (LocalConnection& client : clients_) {
          client.send(block);
        }
      }
      for (LocalConnection& client : clients_) {
        listen(client, component);
      }
      clients_.remove_if([](const LocalConnection& client) { return !client.open(); });
      if (silence.update(heard || watch_.starved(), seconds()) > options_.silence_timeout) {
        std::cerr << "linuxcnc_stream: the controller is silent\n";
        return CONTROLLER_ENDED;
      }
    }
    return 0;
  }

 private:
  static void listen(LocalConnection& client, Component& component) {
    client.flush();
    client.receive();
    while (const std::optional<Received> received = client.next()) {
      if (const auto* load = std::get_if<SetLoad>(&received->message)) {
        component.setLoad(load->spindle_load);
      } else if (const auto* overrides = std::get_if<SetOverrides>(&received->message)) {
        client.send(component.setOverrides(*overrides), received->sequence);
      }
    }
  }

  const StreamOptions options_;
  LocalDescriptor listener_;
  GatewayWatch watch_;
  std::list<LocalConnection> clients_;
};

}  // namespace
}  // namespace smartmill::cnc::linuxcnc

int main(int argc, char** argv) {
  using namespace smartmill::cnc::linuxcnc;
  std::string folder;
  smartmill::CommandLine line{
      "Publishes every servo cycle of the LinuxCNC on this computer (docs/linuxcnc.md); exits with code 3 "
      "when "
      "it ends."};
  line.option("folder", folder, "folder of the machine; stream.socket is created there").required();
  return smartmill::runProgram(line, argc, argv, [&]() -> int {
    smartmill::catchStopSignals();
    rtapi_set_msg_level(RTAPI_MSG_NONE);
    Server server(folder);
    const std::unique_ptr<Component> component = server.component();
    return component ? server.serve(*component) : 0;
  });
}
