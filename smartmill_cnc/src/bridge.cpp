#include "smartmill_cnc/bridge.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>
#include <limits>
#include <utility>

#include "smartmill_core/error.h"
#include "smartmill_core/units.h"
#include "smartmill_focas/client.h"

namespace smartmill::cnc {
namespace {

using focas::Client;
using focas::ConnectionError;
using focas::FocasError;
using focas::SubReply;
using focas::SubRequest;

constexpr int DEFAULT_DECIMALS = 3;
constexpr int MAX_DECIMALS = 6;
constexpr int MAX_MARKER = 9999999;  // seven digits are exact in any variable

/// What is asked of the controller in every period: one PDU, or several when it does not take them all at
/// once.
class Questions {
 public:
  Questions(const focas::ControllerInfo& info, int marker_macro, bool all_at_once) {
    status = begin(focas::OP_STATUS);
    add(focas::OP_HDCK);
    add(focas::OP_TMMODE);
    alarm = begin(focas::OP_ALARM);
    program = begin(focas::OP_PROGRAM_NUMBER);
    sequence = begin(focas::OP_SEQUENCE_NUMBER);
    feed = begin(focas::OP_ACTUAL_FEED);
    speed = begin(focas::OP_ACTUAL_SPEED);
    machine = begin(focas::OP_POSITION, focas::POSITION_MACHINE, -1);
    distance = begin(focas::OP_POSITION, focas::POSITION_DISTANCE, -1);
    absolute = begin(focas::OP_POSITION, focas::POSITION_ABSOLUTE, -1);
    marker = begin(focas::OP_READ_MACRO, marker_macro, marker_macro);
    begin(focas::OP_LOCK, 1);
    if (info.spindle_meter) {
      add(focas::OP_SPINDLE_NAMES, -1);
      spindle_load = add(focas::OP_SPINDLE, focas::SPINDLE_METER_LOAD, -1);
      spindle_speed = add(focas::OP_SPINDLE, focas::SPINDLE_METER_SPEED, -1);
    } else {
      spindle_load = add(focas::OP_SPINDLE, focas::SPINDLE_LOAD, -1);
      spindle_speed = add(focas::OP_SPINDLE, focas::SPINDLE_SPEED, -1);
    }
    add(focas::OP_LOCK, 1);
    begin(focas::OP_LOCK, 2);
    axis_names = add(focas::OP_AXIS_NAMES, 0);
    axis_load = add(focas::OP_SERVO, 1);
    add(focas::OP_LOCK, 2);
    if (all_at_once) {
      starts_ = {0};
    }
  }

  std::vector<SubReply> ask(Client& client) const {
    std::vector<SubReply> replies;
    for (std::size_t i = 0; i < starts_.size(); ++i) {
      const std::size_t end = i + 1 < starts_.size() ? starts_[i + 1] : requests_.size();
      const std::vector<SubRequest> part(requests_.begin() + static_cast<std::ptrdiff_t>(starts_[i]),
                                         requests_.begin() + static_cast<std::ptrdiff_t>(end));
      try {
        std::vector<SubReply> answers = client.exchange(part);
        std::move(answers.begin(), answers.end(), std::back_inserter(replies));
      } catch (const FocasError& e) {
        if (!client.connected() || starts_.size() == 1) {
          throw;
        }
        // One refused question leaves the others standing.
        SubReply refused;
        refused.code = static_cast<std::int16_t>(e.code());
        replies.insert(replies.end(), part.size(), refused);
      }
    }
    return replies;
  }

  std::size_t status, alarm, program, sequence, feed, speed, machine, distance, absolute, marker,
      spindle_load, spindle_speed, axis_names, axis_load;

 private:
  std::size_t add(std::uint16_t opcode, std::int32_t v1 = 0, std::int32_t v2 = 0) {
    requests_.emplace_back(opcode, v1, v2);
    return requests_.size() - 1;
  }
  std::size_t begin(std::uint16_t opcode, std::int32_t v1 = 0, std::int32_t v2 = 0) {
    starts_.push_back(requests_.size());
    return add(opcode, v1, v2);
  }

  std::vector<SubRequest> requests_;
  std::vector<std::size_t> starts_;
};

enum class Phase { idle, opening, sending, running, stopping };

struct Piece {
  std::string name;
  std::string text;
  int marker = 0;
  bool orient = false;
  int axis = -1;  // of a jog
  std::optional<CuttingCondition> condition;
};

std::int32_t firstInteger(const SubReply& reply) {
  return reply.code == focas::EW_OK && reply.data.size() >= 4 ? focas::Reader(reply.data).i32() : 0;
}

/// Teaching counts as the mode it happens in; what has no name must not pass for DNC.
CncMode modeOf(int aut) {
  switch (aut) {
    case focas::AUT_MEM:
    case focas::AUT_EDIT:
    case focas::AUT_HANDLE:
    case focas::AUT_JOG:
    case focas::AUT_INC:
    case focas::AUT_REF:
    case focas::AUT_REMOTE:
      return static_cast<CncMode>(aut);
    case 6:
      return CncMode::jog;
    case 7:
      return CncMode::handle;
    default:
      return CncMode::mdi;
  }
}

double firstValue(const SubReply& reply) {
  const std::vector<double> values = focas::decodeValues(reply, 1);
  return values.empty() || std::isnan(values.front()) ? 0.0 : values.front();
}

}  // namespace

void BridgeParameters::validate() const {
  const auto refuse = [](const std::string& key, double value, const std::string& due) {
    throw Error(key + ": " + fixedDecimals(value, 3) + " is not " + due);
  };
  if (host.empty()) {
    throw Error("host: is empty");
  }
  if (port < 1 || port > 65535) {
    refuse("port", port, "within 1 .. 65535");
  }
  if (spindle < 1) {
    refuse("spindle", spindle, "1 or more");
  }
  for (const auto& [key, value] :
       {std::pair<const char*, int>{"marker_macro", marker_macro}, {"orient_macro", orient_macro}}) {
    if (value < 1 || value > 99999) {
      refuse(key, value, "within 1 .. 99999");
    }
  }
  if (marker_macro == orient_macro) {
    refuse("marker_macro", marker_macro, "another variable than orient_macro");
  }
  for (const auto& [key, value] : {std::pair<const char*, double>{"reply_timeout", reply_timeout},
                                   {"reconnect_period", reconnect_period},
                                   {"settle_time", settle_time},
                                   {"standstill_speed", standstill_speed},
                                   {"stall_timeout", stall_timeout},
                                   {"stop_timeout", stop_timeout},
                                   {"open_timeout", open_timeout}}) {
    if (!(value > 0.0) || !std::isfinite(value)) {
      refuse(key, value, "above 0");
    }
  }
  if (!(condition_lead >= 0.0 && condition_lead <= 10.0)) {
    refuse("condition_lead", condition_lead, "within 0 .. 10");
  }
  limits.validate();
}

class Bridge::Impl {
 public:
  explicit Impl(const BridgeParameters& parameters) : parameters_(parameters) { parameters_.validate(); }

  ~Impl() { shutdown(); }

  void fetch(double now) {
    replies_.clear();
    if (!client_.connected()) {
      if (now < next_connect_ && now >= next_connect_ - parameters_.reconnect_period) {
        return;
      }
      next_connect_ = now + parameters_.reconnect_period;
      connect();
    }
    if (!client_.connected()) {
      return;
    }
    guarded([&] {
      try {
        replies_ = questions_->ask(client_);
      } catch (const FocasError& e) {
        if (!client_.connected() || !all_at_once_) {
          throw;
        }
        setAllAtOnce(false);
        replies_ = questions_->ask(client_);
      }
      if (replies_[questions_->status].code != focas::EW_OK ||
          replies_[questions_->machine].code != focas::EW_OK ||
          replies_[questions_->distance].code != focas::EW_OK) {
        replies_.clear();
        throw FocasError("controller " + where() + " refuses its status or positions", focas::EW_FUNC);
      }
      answered_ = true;
    });
  }

  void step(double now) {
    now_ = now;
    state_.stamp = now;
    load_.reset();
    if (replies_.empty()) {
      // fetch() has failed, or a command has found the connection dead since.
      noteLost();
      return;
    }
    guarded([&] {
      decode();
      watch();
      advance();
    });
    if (!client_.connected()) {
      noteLost();
    }
  }

  const CncState& state() const { return state_; }
  const std::optional<LoadSample>& load() const { return load_; }
  double increment() const { return units::MM * std::pow(10.0, -decimals_); }

  Answer<ArmCode> arm(bool on) {
    if (!on) {
      disarm();
      return {ArmCode::ok, "motion is disarmed"};
    }
    if (!state_.connected || !client_.connected()) {
      return {ArmCode::not_connected, "no connection to the controller " + where()};
    }
    if (state_.armed) {
      return {ArmCode::ok, "motion is armed already"};
    }
    if (state_.emergency || state_.alarm) {
      return {ArmCode::alarm, "motion is not armed: " + alarmLine()};
    }
    if (state_.mode != CncMode::dnc) {
      return {ArmCode::wrong_mode, "motion is not armed: " + modeLine()};
    }
    Answer<ArmCode> answer{ArmCode::ok, "motion is armed"};
    const bool alive = guarded([&] {
      try {
        openSession();
        setArmed(true);
      } catch (const ConnectionError&) {
        throw;
      } catch (const FocasError& e) {
        answer = {e.code() == focas::EW_ALARM ? ArmCode::alarm : ArmCode::wrong_mode,
                  "motion is not armed: " + sessionLine(e)};
      }
    });
    return alive ? answer : Answer<ArmCode>{ArmCode::not_connected, "motion is not armed: " + last_error_};
  }

  Answer<MacroCode> setMacro(int number, double value) {
    if (!client_.connected()) {
      return {MacroCode::not_connected, "no connection to the controller " + where()};
    }
    if (number == parameters_.marker_macro) {
      return {MacroCode::refused, "#" + std::to_string(number) + " is the bridge's own variable"};
    }
    if (!std::isfinite(value)) {
      return {MacroCode::refused, "#" + std::to_string(number) + ": the value is not a finite number"};
    }
    Answer<MacroCode> answer{MacroCode::ok, "#" + std::to_string(number) + " is set"};
    const bool alive = guarded([&] {
      try {
        client_.writeMacro(number, value);
      } catch (const ConnectionError&) {
        throw;
      } catch (const FocasError& e) {
        answer = {MacroCode::refused, e.what()};
      }
    });
    return alive ? answer : Answer<MacroCode>{MacroCode::not_connected, last_error_};
  }

  std::optional<Outcome> runProgram(const std::string& name, const std::string& program,
                                    const CuttingCondition& condition) {
    Piece piece;
    piece.name = "program " + (name.empty() ? "without name" : name);
    if (condition.kind != CuttingCondition::Kind::none) {
      piece.condition = condition;
    }
    return start(std::move(piece), program);
  }

  std::optional<Outcome> jog(const std::string& axis, double distance, double feed) {
    Piece piece;
    piece.axis = axis == "x" || axis == "X"   ? 0
                 : axis == "y" || axis == "Y" ? 1
                 : axis == "z" || axis == "Z" ? 2
                                              : -1;
    piece.name = "jog " + axis;
    if (piece.axis < 0) {
      return Outcome{MotionCode::bad_goal, "jog: axis '" + axis + "', x, y or z is due"};
    }
    if (!std::isfinite(distance) || !std::isfinite(feed) || feed < 0.0) {
      return Outcome{MotionCode::bad_goal,
                     "jog " + axis + ": a finite distance and a feed of 0 or more are due"};
    }
    return start(std::move(piece), jogProgram(piece.axis < 0 ? 0 : piece.axis, distance, feed, decimals_));
  }

  std::optional<Outcome> orient(double angle) {
    if (!std::isfinite(angle)) {
      return Outcome{MotionCode::bad_goal, "orient spindle: the angle is not a finite number"};
    }
    Piece piece;
    piece.name = "orient spindle";
    piece.orient = true;
    return start(std::move(piece), orientProgram(angle, parameters_.orient_macro));
  }

  void cancel() {
    if (phase_ == Phase::opening) {
      finish({MotionCode::cancelled, piece_.name + ": cancelled before anything was sent"});
    } else if (phase_ == Phase::sending || phase_ == Phase::running) {
      guarded([&] { stop({MotionCode::cancelled, piece_.name + ": cancelled"}); });
    }
  }

  void shutdown() {
    if (!client_.connected()) {
      return;
    }
    const bool alive = guarded([&] {
      if (phase_ == Phase::sending || phase_ == Phase::running) {
        stop({MotionCode::cancelled, piece_.name + ": the bridge ends"});
      }
      disarm();
    });
    if (alive) {
      client_.close();
    }
    state_.connected = false;
  }

  bool busy() const { return phase_ != Phase::idle; }

  Progress progress() const {
    Progress p;
    p.bytes_sent = sent_;
    p.bytes_total = piece_.text.size();
    switch (phase_) {
      case Phase::idle:
        break;
      case Phase::opening:
        p.stage = "opening";
        break;
      case Phase::sending:
        p.stage = "sending";
        break;
      case Phase::running:
        p.stage = "running";
        break;
      case Phase::stopping:
        p.stage = "stopping";
        break;
    }
    if (piece_.axis >= 0 && axisIndex(piece_.axis) < state_.distance_to_go.size()) {
      p.distance_to_go = state_.distance_to_go[axisIndex(piece_.axis)];
    }
    return p;
  }

  std::optional<Outcome> takeOutcome() { return std::exchange(outcome_, std::nullopt); }
  std::vector<CuttingCondition> takeConditions() { return std::exchange(conditions_, {}); }
  std::vector<Note> takeNotes() { return std::exchange(notes_, {}); }

 private:
  std::string where() const { return parameters_.host + ":" + std::to_string(parameters_.port); }

  /// Where the controller keeps x (0), y (1), z (2); beyond its axes when it has no such axis.
  std::size_t axisIndex(int axis) const {
    const auto found = std::find(state_.axes.begin(), state_.axes.end(), std::string(1, "XYZ"[axis]));
    return static_cast<std::size_t>(found - state_.axes.begin());
  }

  void note(Note::Level level, const std::string& text) { notes_.push_back({level, text}); }

  /// Runs something that talks to the controller; false when the connection went with it.
  template <class Talk>
  bool guarded(Talk&& talk) {
    try {
      talk();
      return true;
    } catch (const std::exception& e) {
      last_error_ = e.what();
      client_.drop();
      replies_.clear();
      return false;
    }
  }

  void connect() {
    try {
      client_.connect(parameters_.host, static_cast<std::uint16_t>(parameters_.port),
                      parameters_.reply_timeout);
      // A controller that went away at the first large question may like small ones better.
      if (asked_ && !answered_) {
        all_at_once_ = !all_at_once_;
      }
      asked_ = true;
      answered_ = false;
      setAllAtOnce(all_at_once_);
    } catch (const std::exception& e) {
      last_error_ = e.what();
    }
  }

  void setAllAtOnce(bool all_at_once) {
    all_at_once_ = all_at_once;
    questions_ = std::make_unique<Questions>(client_.info(), parameters_.marker_macro, all_at_once);
  }

  /// One line when a connection breaks or does not come about, not one a period.
  void noteLost() {
    const bool was_connected = std::exchange(state_.connected, false);
    session_ = false;
    state_.armed = false;
    if (phase_ != Phase::idle) {
      last_error_ = piece_.name + ": " + last_error_;
      finish({MotionCode::lost, last_error_});
    }
    // That nothing can be reached after a loss is no news; a refusal of another kind is.
    const bool expected = lost_noted_ && !was_connected;
    if (was_connected || (last_error_ != noted_error_ && !expected)) {
      note(Note::Level::error,
           last_error_ + "; trying again every " + fixedDecimals(parameters_.reconnect_period, 1) + " s");
    }
    lost_noted_ = was_connected || (lost_noted_ && last_error_ == noted_error_);
    noted_error_ = last_error_;
  }

  void noteConnected() {
    if (state_.connected) {
      return;
    }
    state_.connected = true;
    noted_error_.clear();
    const focas::ControllerInfo& info = client_.info();
    std::string axes;
    for (const std::string& axis : state_.axes) {
      axes += " " + axis;
    }
    note(Note::Level::info, "connected to the controller " + where() + ": type " + info.cnc_type +
                                info.mt_type + ", series " + info.series + ", axes" + axes);
  }

  void decode() {
    const Questions& q = *questions_;
    const std::size_t axes = static_cast<std::size_t>(client_.info().axes);
    focas::Reader reader(replies_[q.status].data);
    status_ = focas::decodeStatus(reader);
    state_.mode = modeOf(status_.aut);
    state_.run =
        static_cast<CncRun>(std::clamp<std::int16_t>(status_.run, focas::RUN_RESET, focas::RUN_START));
    state_.motion = status_.motion == focas::MOTION_MOVES;
    state_.emergency = status_.emergency != 0;
    state_.alarm = status_.alarm == 1;
    state_.program = firstInteger(replies_[q.program]);
    state_.sequence = firstInteger(replies_[q.sequence]);
    state_.feed = firstValue(replies_[q.feed]) * units::MM / 60.0;
    state_.spindle_speed = units::radPerSecFromRpm(firstValue(replies_[q.speed]));
    state_.position = lengths(replies_[q.machine], axes);
    state_.distance_to_go = lengths(replies_[q.distance], axes);
    absolute_ = lengths(replies_[q.absolute], axes);
    if (absolute_.empty()) {
      absolute_ = state_.position;
    }
    if (state_.position.size() != axes || state_.distance_to_go.size() != axes || absolute_.size() != axes) {
      throw FocasError("controller " + where() + " tells positions of fewer axes than it has",
                       focas::EW_LENGTH);
    }
    readDecimals(replies_[q.machine]);
    state_.axes = focas::decodeNames(replies_[q.axis_names], axes);
    for (std::size_t i = state_.axes.size(); i < axes; ++i) {
      state_.axes.push_back(i < 3 ? std::string(1, "XYZ"[i]) : "A" + std::to_string(i + 1));
    }
    const std::vector<double> marker = focas::decodeValues(replies_[q.marker], 1);
    marker_ = marker.empty() ? std::numeric_limits<double>::quiet_NaN() : marker.front();
    const std::uint32_t bits = static_cast<std::uint32_t>(firstInteger(replies_[q.alarm]));
    readAlarms(bits);
    decodeLoad(axes);
    noteConnected();
  }

  static std::vector<double> lengths(const SubReply& reply, std::size_t axes) {
    std::vector<double> values = focas::decodeValues(reply, axes);
    for (double& value : values) {
      value *= units::MM;
    }
    return values;
  }

  void readDecimals(const SubReply& reply) {
    const focas::Value8 first = focas::Reader(reply.data).value8();
    decimals_ =
        first.base == 10 && first.exp >= 0 ? std::min<int>(first.exp, MAX_DECIMALS) : DEFAULT_DECIMALS;
  }

  void readAlarms(std::uint32_t bits) {
    if (!state_.alarm && bits == 0) {
      state_.alarm_text.clear();
      alarm_bits_ = 0;
      return;
    }
    if (bits == alarm_bits_ && !state_.alarm_text.empty()) {
      return;
    }
    alarm_bits_ = bits;
    state_.alarm_text.clear();
    try {
      for (const focas::AlarmMessage& alarm : client_.alarmMessages()) {
        state_.alarm_text += (state_.alarm_text.empty() ? "" : "; ") + std::to_string(alarm.number) +
                             (alarm.text.empty() ? "" : " " + alarm.text);
      }
    } catch (const ConnectionError&) {
      throw;
    } catch (const FocasError&) {
      // The bits below say as much as the controller tells.
    }
    if (state_.alarm_text.empty()) {
      state_.alarm_text = "alarm bits " + std::to_string(bits);
    }
  }

  void decodeLoad(std::size_t axes) {
    const Questions& q = *questions_;
    const std::size_t spindle = static_cast<std::size_t>(parameters_.spindle - 1);
    const std::vector<double> load = focas::decodeValues(replies_[q.spindle_load], spindle + 1);
    const std::vector<double> speed = focas::decodeValues(replies_[q.spindle_speed], spindle + 1);
    if (load.size() <= spindle) {
      return;
    }
    LoadSample sample;
    sample.stamp = now_;
    sample.spindle_load = load[spindle] / 100.0;
    sample.spindle_speed =
        speed.size() > spindle ? units::radPerSecFromRpm(speed[spindle]) : state_.spindle_speed;
    sample.axes = state_.axes;
    sample.axis_load = focas::decodeValues(replies_[q.axis_load], axes);
    for (double& value : sample.axis_load) {
      value = std::abs(value) / 100.0;
    }
    sample.axis_load.resize(axes, std::numeric_limits<double>::quiet_NaN());
    load_ = std::move(sample);
  }

  std::string alarmLine() const {
    return (state_.emergency ? "emergency stop" : "alarm") +
           (state_.alarm_text.empty() ? std::string() : ": " + state_.alarm_text);
  }

  std::string modeLine() const {
    return "the controller is not in DNC mode at its panel (mode " +
           std::to_string(static_cast<int>(state_.mode)) + ")";
  }

  std::string sessionLine(const FocasError& e) const {
    switch (e.code()) {
      case focas::EW_MODE:
        return modeLine();
      case focas::EW_REJECT:
        return "the controller does not take a DNC session yet (press CYCLE START at its panel): " +
               std::string(e.what());
      case focas::EW_BUSY:
        return "another client has a DNC session: " + std::string(e.what());
      default:
        return e.what();
    }
  }

  // --- motion

  void setArmed(bool armed) {
    if (state_.armed != armed) {
      note(Note::Level::info, armed ? "motion is armed" : "motion is disarmed");
    }
    state_.armed = armed;
  }

  void openSession() {
    client_.dncStart();
    session_ = true;
    first_piece_ = true;
    // A marker left from before must not end the first piece.
    client_.writeMacro(parameters_.marker_macro, 0.0);
    next_marker_ = 1;
  }

  void disarm() {
    if (phase_ == Phase::sending || phase_ == Phase::running || phase_ == Phase::opening) {
      cancel();
    }
    setArmed(false);
    if (!session_) {
      return;
    }
    session_ = false;
    guarded([&] {
      try {
        const std::string text = "M30\n%\n";
        if (client_.dncSend(text.data(), text.size()) == text.size()) {
          client_.dncEnd();
        } else {
          client_.dncCancel();
        }
      } catch (const ConnectionError&) {
        throw;
      } catch (const FocasError& e) {
        // The controller has ended the session itself: what was wanted.
        note(Note::Level::info, std::string("end of the DNC session: ") + e.what());
      }
    });
  }

  std::optional<Outcome> start(Piece piece, const std::string& program) {
    const auto refuse = [&](MotionCode code, const std::string& why) {
      return Outcome{code, piece.name + ": " + why};
    };
    if (!state_.connected || !client_.connected()) {
      return refuse(MotionCode::not_connected, "no connection to the controller " + where());
    }
    if (busy()) {
      return refuse(MotionCode::busy, piece_.name + " is running");
    }
    if (state_.emergency || state_.alarm) {
      return refuse(MotionCode::alarm, alarmLine());
    }
    if (state_.mode != CncMode::dnc) {
      return refuse(MotionCode::wrong_mode, modeLine());
    }
    if (!state_.armed) {
      return refuse(MotionCode::not_armed, "motion is not armed");
    }
    StartPosition from;
    for (std::size_t i = 0; i < 3; ++i) {
      const std::size_t axis = axisIndex(static_cast<int>(i));
      if (axis >= state_.position.size()) {
        return refuse(MotionCode::bad_goal, std::string("the controller has no axis ") + "XYZ"[i]);
      }
      from.machine[i] = state_.position[axis];
      from.absolute[i] = absolute_[axis];
    }
    DialectOptions options;
    options.marker_macro = parameters_.marker_macro;
    options.decimals = decimals_;
    const NcCheck check = checkProgram(program, from, parameters_.limits, options);
    if (check.verdict != NcVerdict::good) {
      const bool limit = check.verdict == NcVerdict::outside_limits;
      return refuse(limit ? MotionCode::limit : MotionCode::bad_goal, check.message);
    }
    piece.text = check.text;
    piece_ = std::move(piece);
    sent_ = 0;
    outcome_.reset();
    enter(Phase::opening);
    return std::nullopt;
  }

  void enter(Phase phase) {
    phase_ = phase;
    entered_ = now_;
    progressed_ = now_;
    still_since_.reset();
  }

  /// What ends a motion from the controller's side.
  void watch() {
    if (!state_.armed) {
      return;
    }
    if (state_.emergency || state_.alarm) {
      giveUp(MotionCode::alarm, alarmLine());
    } else if (state_.mode != CncMode::dnc) {
      giveUp(MotionCode::wrong_mode, modeLine());
    } else if (session_ && phase_ != Phase::stopping) {
      try {
        client_.dncCheck();
      } catch (const ConnectionError&) {
        throw;
      } catch (const FocasError& e) {
        session_ = false;
        const bool reset = e.code() == focas::EW_RESET;
        giveUp(e.code() == focas::EW_ALARM ? MotionCode::alarm : MotionCode::cancelled,
               reset ? "the controller was reset"
                     : "the controller ended the DNC session: " + std::string(e.what()));
      }
    }
  }

  void giveUp(MotionCode code, const std::string& why) {
    note(Note::Level::warning, "motion is disarmed: " + why);
    state_.armed = false;
    if (session_) {
      session_ = false;
      client_.dncCancel();
    }
    if (phase_ != Phase::idle) {
      finish({code, piece_.name + ": " + why});
    }
  }

  void stop(Outcome outcome) {
    stopping_outcome_ = std::move(outcome);
    try {
      // Stops the axes at once; the DNC cancel alone may come late behind text in the stream.
      client_.reset();
    } catch (const ConnectionError&) {
      throw;
    } catch (const FocasError&) {
      // Not every controller lets itself be reset: the cancel must do.
    }
    session_ = false;
    client_.dncCancel();
    enter(Phase::stopping);
  }

  void advance() {
    switch (phase_) {
      case Phase::idle:
        break;
      case Phase::opening:
        advanceOpening();
        break;
      case Phase::sending:
        advanceSending();
        break;
      case Phase::running:
        advanceRunning();
        break;
      case Phase::stopping:
        advanceStopping();
        break;
    }
  }

  void advanceOpening() {
    if (!session_) {
      try {
        openSession();
      } catch (const ConnectionError&) {
        throw;
      } catch (const FocasError& e) {
        const bool later = e.code() == focas::EW_BUSY || e.code() == focas::EW_REJECT;
        if (!later || now_ - entered_ > parameters_.open_timeout) {
          finish({e.code() == focas::EW_ALARM ? MotionCode::alarm : MotionCode::wrong_mode,
                  piece_.name + ": " + sessionLine(e)});
        }
        return;
      }
    }
    if (std::exchange(first_piece_, false)) {
      // A control skips what comes before the first end of block.
      piece_.text.insert(0, "\n");
    }
    piece_.marker = next_marker_;
    next_marker_ = next_marker_ >= MAX_MARKER ? 1 : next_marker_ + 1;
    piece_.text +=
        "#" + std::to_string(parameters_.marker_macro) + "=" + std::to_string(piece_.marker) + "\n";
    enter(Phase::sending);
    // Told ahead: it is with everybody when its time has come, and nothing of it has begun before.
    condition_from_ = now_;
    if (piece_.condition) {
      condition_from_ += parameters_.condition_lead;
      piece_.condition->stamp = condition_from_;
      conditions_.push_back(*piece_.condition);
    }
    advanceSending();
  }

  /// Text that the controller does not take now waits for the next step.
  void advanceSending() {
    if (now_ < condition_from_) {
      progressed_ = now_;
      return;
    }
    try {
      const std::size_t taken = client_.dncSend(piece_.text.data() + sent_, piece_.text.size() - sent_);
      sent_ += taken;
      if (taken > 0) {
        progressed_ = now_;
      }
      if (sent_ == piece_.text.size() && client_.dncFlush() == 0) {
        enter(Phase::running);
        return;
      }
    } catch (const ConnectionError&) {
      throw;
    } catch (const FocasError& e) {
      session_ = false;
      giveUp(e.code() == focas::EW_ALARM ? MotionCode::alarm : MotionCode::cancelled, sessionLine(e));
      return;
    }
    checkStall();
  }

  void advanceRunning() {
    const bool distance_left = std::any_of(state_.distance_to_go.begin(), state_.distance_to_go.end(),
                                           [](double d) { return d != 0.0; });
    const bool spindle_turns = piece_.orient && std::abs(state_.spindle_speed) > parameters_.standstill_speed;
    const bool done = marker_ == static_cast<double>(piece_.marker) && !distance_left &&
                      status_.motion == focas::MOTION_NONE && !spindle_turns;
    if (!done) {
      still_since_.reset();
      checkStall();
      return;
    }
    if (!still_since_) {
      still_since_ = now_;
    }
    if (now_ - *still_since_ < parameters_.settle_time) {
      return;
    }
    if (piece_.condition) {
      // Its end is told ahead too; the outcome waits for it, so that whoever asks for results asks after it.
      CuttingCondition none;
      none.stamp = condition_to_ = now_ + parameters_.condition_lead;
      conditions_.push_back(none);
      piece_.condition.reset();
    }
    if (now_ >= condition_to_) {
      finish({MotionCode::ok, piece_.name + ": done"});
    }
  }

  void checkStall() {
    if (status_.motion != focas::MOTION_NONE || state_.run == CncRun::hold ||
        state_.sequence != stall_sequence_ || state_.spindle_speed != stall_speed_ ||
        state_.position != stall_position_) {
      progressed_ = now_;
    }
    stall_sequence_ = state_.sequence;
    stall_speed_ = state_.spindle_speed;
    stall_position_ = state_.position;
    if (now_ - progressed_ > parameters_.stall_timeout) {
      stop({MotionCode::cancelled,
            piece_.name + ": nothing has moved for " + fixedDecimals(parameters_.stall_timeout, 0) + " s"});
    }
  }

  void advanceStopping() {
    const bool stands = status_.motion == focas::MOTION_NONE && state_.position == stall_position_;
    stall_position_ = state_.position;
    const bool too_long = now_ - entered_ > parameters_.stop_timeout;
    if (!stands && !too_long) {
      return;
    }
    Outcome outcome = stopping_outcome_;
    if (!stands) {
      outcome.message += "; the machine STILL MOVES: use the panel";
    } else {
      outcome.message += "; stopped at";
      for (std::size_t i = 0; i < state_.position.size(); ++i) {
        outcome.message += " " + state_.axes[i] + fixedDecimals(state_.position[i] / units::MM, decimals_);
      }
      outcome.message += " mm";
    }
    finish(outcome);
  }

  void finish(const Outcome& outcome) {
    if (piece_.condition &&
        (phase_ == Phase::sending || phase_ == Phase::running || phase_ == Phase::stopping)) {
      CuttingCondition none;
      none.stamp = std::max(now_, condition_from_ + 1e-3);
      conditions_.push_back(none);
    }
    if (outcome.code != MotionCode::ok && outcome.code != MotionCode::lost) {
      note(Note::Level::warning, outcome.message);
    }
    outcome_ = outcome;
    enter(Phase::idle);
  }

  BridgeParameters parameters_;
  Client client_;
  std::unique_ptr<Questions> questions_;
  bool all_at_once_ = true;
  bool asked_ = false, answered_ = false;
  std::vector<SubReply> replies_;
  double next_connect_ = -std::numeric_limits<double>::infinity();  // [s]
  bool lost_noted_ = false;
  std::string last_error_ = "not connected yet", noted_error_ = "not connected yet";

  double now_ = 0.0;  // [s]
  CncState state_;
  std::optional<LoadSample> load_;
  focas::Status status_;
  std::vector<double> absolute_;  // [m]
  double marker_ = std::numeric_limits<double>::quiet_NaN();
  std::uint32_t alarm_bits_ = 0;
  int decimals_ = DEFAULT_DECIMALS;

  bool session_ = false, first_piece_ = false;
  int next_marker_ = 1;
  Phase phase_ = Phase::idle;
  Piece piece_;
  std::size_t sent_ = 0;     // [byte]
  double entered_ = 0.0;     // [s] into the phase
  double progressed_ = 0.0;  // [s]
  std::optional<double> still_since_;
  int stall_sequence_ = 0;
  double stall_speed_ = 0.0;
  std::vector<double> stall_position_;
  Outcome stopping_outcome_;
  std::optional<Outcome> outcome_;
  std::vector<CuttingCondition> conditions_;
  double condition_from_ = 0.0, condition_to_ = 0.0;  // [s] of the running piece
  std::vector<Note> notes_;
};

Bridge::Bridge(const BridgeParameters& parameters) : impl_(std::make_unique<Impl>(parameters)) {
}
Bridge::~Bridge() = default;
void Bridge::fetch(double now) {
  impl_->fetch(now);
}
void Bridge::step(double now) {
  impl_->step(now);
}
const CncState& Bridge::state() const {
  return impl_->state();
}
const std::optional<LoadSample>& Bridge::load() const {
  return impl_->load();
}
double Bridge::positionIncrement() const {
  return impl_->increment();
}
Answer<ArmCode> Bridge::arm(bool on) {
  return impl_->arm(on);
}
Answer<MacroCode> Bridge::setMacro(int number, double value) {
  return impl_->setMacro(number, value);
}
std::optional<Outcome> Bridge::runProgram(const std::string& name, const std::string& program,
                                          const CuttingCondition& condition) {
  return impl_->runProgram(name, program, condition);
}
std::optional<Outcome> Bridge::jog(const std::string& axis, double distance, double feed) {
  return impl_->jog(axis, distance, feed);
}
std::optional<Outcome> Bridge::orient(double angle) {
  return impl_->orient(angle);
}
void Bridge::cancel() {
  impl_->cancel();
}
void Bridge::shutdown() {
  impl_->shutdown();
}
bool Bridge::busy() const {
  return impl_->busy();
}
Progress Bridge::progress() const {
  return impl_->progress();
}
std::optional<Outcome> Bridge::takeOutcome() {
  return impl_->takeOutcome();
}
std::vector<CuttingCondition> Bridge::takeConditions() {
  return impl_->takeConditions();
}
std::vector<Note> Bridge::takeNotes() {
  return impl_->takeNotes();
}

}  // namespace smartmill::cnc
