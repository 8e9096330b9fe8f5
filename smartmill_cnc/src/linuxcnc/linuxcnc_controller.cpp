#include "smartmill_cnc/linuxcnc/linuxcnc_controller.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "smartmill_cnc/linuxcnc/gateway_client.h"
#include "smartmill_cnc/linuxcnc/silence_timer.h"
#include "smartmill_core/error.h"
#include "smartmill_core/nc/orientation.h"
#include "smartmill_core/units.h"

namespace smartmill::cnc::linuxcnc {
namespace {

constexpr int DECIMALS = 4;             // of lengths in mm; LinuxCNC computes in doubles
constexpr double ZERO_DISTANCE = 1e-9;  // [m] a smaller distance to go counts as zero

Failure::Kind kindOf(Reply::Code code) {
  switch (code) {
    case Reply::Code::lost:
      return Failure::Kind::lost;
    case Reply::Code::emergency:
      return Failure::Kind::alarm;
    case Reply::Code::wrong_mode:
      return Failure::Kind::wrong_mode;
    case Reply::Code::not_yet:
      return Failure::Kind::not_yet;
    case Reply::Code::done:
    case Reply::Code::refused:
      break;
  }
  return Failure::Kind::refused;
}

/// Mode for arming and running: DNC while programs are accepted.
CncMode modeOf(const MachineStatus& status, bool open) {
  switch (status.mode) {
    case MachineStatus::Mode::mdi:
      return CncMode::dnc;
    case MachineStatus::Mode::manual:
      return open || status.busy ? CncMode::jog : CncMode::dnc;
    case MachineStatus::Mode::automatic:
      break;
  }
  return CncMode::mem;
}

/// @param open programs are accepted @param done every block of the last program has been executed
Reading readingOf(const MachineStatus& status, const ServoSample& servo, bool open, bool done) {
  Reading reading;
  CncState& state = reading.state;
  const bool on = status.state == MachineStatus::State::on;
  state.mode = modeOf(status, open);
  state.run = status.held ? CncRun::hold : status.busy ? CncRun::start : open ? CncRun::stop : CncRun::reset;
  state.motion = !status.in_position || std::abs(status.velocity) > 0.0;
  state.emergency = status.state == MachineStatus::State::emergency;
  state.alarm = !status.errors.empty() || (!on && !state.emergency);
  state.alarm_text = status.errors.empty() && state.alarm ? "the machine is off" : status.errors;
  if (!status.errors.empty()) {
    reading.alarms.push_back({0, 0, 0, status.errors});
  }
  state.sequence = status.line;
  state.axes = {"X", "Y", "Z"};
  state.position.assign(status.position.begin(), status.position.end());
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const double to_go = status.distance_to_go[axis];
    state.distance_to_go.push_back(std::abs(to_go) < ZERO_DISTANCE ? 0.0 : to_go);
    reading.absolute.push_back(status.position[axis] - status.offset[axis]);
  }
  state.spindle_speed = std::abs(servo.spindle_speed);
  state.feed = status.velocity;
  reading.at_rest = !state.motion && status.dwell_left <= 0.0;
  reading.program_done = done;
  LoadSample load;
  load.spindle_load = servo.spindle_load;
  load.spindle_speed = state.spindle_speed;
  load.axes = state.axes;
  load.axis_load.assign(3, NOT_A_NUMBER);
  reading.load = std::move(load);
  return reading;
}

class LinuxCncController : public Controller {
 public:
  LinuxCncController(const LinuxCncParameters& parameters, std::shared_ptr<const ServoStream> stream,
                     double (*now)())
      : folder_(parameters.folder),
        timeout_(parameters.timeout),
        stream_timeout_(parameters.stream_timeout),
        client_(parameters.folder, parameters.timeout),
        stream_(std::move(stream)),
        now_(now) {}

  std::string name() const override { return "controller LinuxCNC in " + folder_; }

  Result<std::string> connect() override {
    try {
      client_.connect();
      const MachineStatus status = client_.status();
      if (!status.alive || !status.homed) {
        return lost(
            "cannot connect to the " + name() +
            (status.alive ? ": it is not ready (run linuxcnc_panel FOLDER ready)" : ": it does not run"));
      }
    } catch (const Error& e) {
      return lost(e.what());
    }
    return std::string("LinuxCNC");
  }
  bool connected() const override { return client_.connected(); }
  void close() override { client_.close(); }

  Result<Reading> read() override {
    try {
      status_ = client_.status();
    } catch (const Error& e) {
      return lost(e.what());
    }
    if (!status_.alive) {
      return lost("connection to the " + name() + " lost: " + status_.errors);
    }
    const std::optional<ServoSample> servo = stream_->latest();
    const std::uint64_t count = stream_->count();
    // Silence while the controller waits for a processor does not count.
    const bool heard = std::exchange(servo_count_, count) != count || status_.starved > 0.0;
    const double silence = silence_.update(heard, now_());
    if (!servo || silence > stream_timeout_) {
      return lost("connection to the " + name() + " lost: its servo stream is silent");
    }
    return readingOf(status_, *servo, open_, complete_ && status_.done == number_);
  }

  Status setVariable(int number, double value) override {
    return execute({CommandCode::variable, number, value, {}});
  }

  DialectOptions dialect() const override {
    DialectOptions options;
    options.marker_macro = 0;  // no marker variable needed
    options.decimals = DECIMALS;
    return options;
  }
  std::string orientProgram(double angle) const override {
    return cnc::orientProgram(angle, nc::ORIENT_VARIABLE);
  }

  Status openPrograms() override {
    const Status opened = execute({CommandCode::open, 0, 0.0, {}});
    open_ = static_cast<bool>(opened);
    if (open_) {
      status_.mode = MachineStatus::Mode::mdi;
    }
    return opened;
  }
  bool programsOpen() const override { return open_ && client_.connected(); }
  Status checkPrograms() override {
    if (status_.mode == MachineStatus::Mode::mdi) {
      return {};
    }
    open_ = false;
    return Failure{Failure::Kind::wrong_mode, "the controller is no longer in MDI"};
  }
  Status closePrograms() override {
    return std::exchange(open_, false) ? execute({CommandCode::close, 0, 0.0, {}}) : Status();
  }

  void begin(const std::string& program) override {
    text_ = linuxCncText(program);
    ++number_;
    complete_ = false;
  }
  Status send() override {
    const Status taken = execute({CommandCode::run, number_, 0.0, text_});
    complete_ = static_cast<bool>(taken);
    if (!taken && taken.failure().kind == Failure::Kind::not_yet) {
      return {};
    }
    open_ = open_ && complete_;
    return taken;
  }
  Transfer transfer() const override { return {complete_ ? text_.size() : 0, text_.size(), complete_}; }
  Status abandonPrograms() override {
    open_ = false;
    return execute({CommandCode::abort, 0, 0.0, {}});
  }
  Status abort() override { return abandonPrograms(); }
  bool takesOverrides() const override { return true; }
  Result<Overrides> setOverrides(const Overrides& wanted) override {
    const Overrides taken{std::min(1.0, wanted.feed), wanted.spindle};
    const Reply reply = sendToStream(SetOverrides{taken.feed, taken.spindle});
    if (reply.code != Reply::Code::done) {
      return Failure{kindOf(reply.code), reply.text};
    }
    return taken;
  }
  Status hold() override { return execute({CommandCode::hold, 0, 0.0, {}}); }

 private:
  Failure lost(const std::string& why) {
    client_.close();
    open_ = false;
    return {Failure::Kind::lost, why};
  }

  /// Uses a connection of its own, since that of the servo cycles is read elsewhere.
  Reply sendToStream(const SetOverrides& overrides) const {
    try {
      GatewayClient stream(folder_, timeout_, STREAM_SOCKET);
      stream.connect();
      return stream.carryOut(overrides);
    } catch (const Error& e) {
      return {Reply::Code::refused, e.what()};
    }
  }

  Status execute(const Command& command) {
    try {
      const Reply reply = client_.carryOut(command);
      if (reply.code == Reply::Code::done) {
        return {};
      }
      return reply.code == Reply::Code::lost ? lost(reply.text) : Failure{kindOf(reply.code), reply.text};
    } catch (const Error& e) {
      return lost(e.what());
    }
  }

  const std::string folder_;
  const double timeout_, stream_timeout_;  // [s]
  GatewayClient client_;
  std::shared_ptr<const ServoStream> stream_;
  double (*now_)();
  SilenceTimer silence_;
  std::uint64_t servo_count_ = 0;
  MachineStatus status_;
  bool open_ = false, complete_ = false;
  std::string text_;
  std::int32_t number_ = 0;
};

}  // namespace

std::unique_ptr<Controller> makeLinuxCncController(const LinuxCncParameters& parameters,
                                                   std::shared_ptr<const ServoStream> stream,
                                                   double (*now)()) {
  if (parameters.folder.empty()) {
    throw Error("linuxcnc_folder: empty, expected the folder of the machine");
  }
  return std::make_unique<LinuxCncController>(parameters, std::move(stream), now);
}

}  // namespace smartmill::cnc::linuxcnc
