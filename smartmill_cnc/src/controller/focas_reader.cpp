#include "controller/focas_reader.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>
#include <utility>

#include "smartmill_core/units.h"

namespace smartmill::cnc {
namespace {

using focas::FocasError;
using focas::SubReply;
using focas::SubRequest;

constexpr int DEFAULT_DECIMALS = 3;
constexpr int MAX_DECIMALS = 6;
constexpr int AXIS_MOTOR = 308, AXIS_ENCODER = 309, SPINDLE_MOTOR = 403;  // diagnosis numbers [deg C]

std::int32_t firstInteger(const SubReply& reply) {
  return reply.code == focas::EW_OK && reply.data.size() >= 4 ? focas::Reader(reply.data).i32() : 0;
}

double firstValue(const SubReply& reply) {
  const std::vector<double> values = focas::decodeValues(reply, 1);
  return values.empty() || std::isnan(values.front()) ? 0.0 : values.front();
}

std::vector<double> lengths(const SubReply& reply, std::size_t axes) {
  std::vector<double> values = focas::decodeValues(reply, axes);
  for (double& value : values) {
    value *= units::MM;
  }
  return values;
}

int decimalsOf(const SubReply& reply) {
  const focas::Value8 first = focas::Reader(reply.data).value8();
  return first.base == 10 && first.exp >= 0 ? std::min<int>(first.exp, MAX_DECIMALS) : DEFAULT_DECIMALS;
}

/// A teaching mode counts as its base mode; an unknown mode must not count as DNC.
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

}  // namespace

/// Requests to the controller in every period.
class FocasReader::PollRequests {
 public:
  PollRequests(const focas::ControllerInfo& info, int marker_macro, bool all_at_once) {
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

  std::vector<SubReply> exchange(focas::Client& client) const {
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
        // A refused request does not affect the others.
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

FocasReader::FocasReader(focas::Client& client, const FocasParameters& parameters)
    : client_(client),
      parameters_(parameters),
      marker_(std::numeric_limits<double>::quiet_NaN()),
      decimals_(DEFAULT_DECIMALS) {
}

FocasReader::~FocasReader() = default;

void FocasReader::connected() {
  // After a disconnection at the first request, tries the other size of requests.
  const bool disconnected = requested_ && !answered_;
  requested_ = true;
  answered_ = false;
  setAllAtOnce(all_at_once_ != disconnected);
}

void FocasReader::setAllAtOnce(bool all_at_once) {
  all_at_once_ = all_at_once;
  poll_requests_ = std::make_unique<PollRequests>(client_.info(), parameters_.marker_macro, all_at_once);
}

std::vector<SubReply> FocasReader::exchange() {
  try {
    return poll_requests_->exchange(client_);
  } catch (const FocasError&) {
    if (!client_.connected() || !all_at_once_) {
      throw;
    }
  }
  setAllAtOnce(false);
  return poll_requests_->exchange(client_);
}

Reading FocasReader::read() {
  const std::vector<SubReply> replies = exchange();
  const PollRequests& q = *poll_requests_;
  for (const std::size_t required : {q.status, q.machine, q.distance}) {
    if (replies[required].code != focas::EW_OK) {
      throw FocasError("the controller refuses its status or positions", focas::EW_FUNC);
    }
  }
  answered_ = true;
  const std::size_t axes = static_cast<std::size_t>(client_.info().axes);
  Reading reading;
  readState(replies, axes, reading);
  readPositions(replies, axes, reading);
  readAlarms(static_cast<std::uint32_t>(firstInteger(replies[q.alarm])), reading.state);
  reading.alarms = alarms_;
  readLoad(replies, axes, reading);
  axes_ = reading.state.axes;
  const std::vector<double> marker = focas::decodeValues(replies[q.marker], 1);
  marker_ = marker.empty() ? std::numeric_limits<double>::quiet_NaN() : marker.front();
  return reading;
}

MachineTemperature FocasReader::readTemperature(std::string& refused) {
  constexpr double NOT_REPORTED = std::numeric_limits<double>::quiet_NaN();
  bool any = false;
  const auto kelvin = [&](int number, int axis, std::size_t count) {
    std::vector<double> values;
    try {
      values = client_.diagnosis(number, axis);
      any = true;
    } catch (const FocasError& e) {
      if (!client_.connected()) {
        throw;
      }
      refused += (refused.empty() ? "" : "; ") + std::string(e.what());
    }
    values.resize(count, NOT_REPORTED);
    for (double& value : values) {
      value += ZERO_CELSIUS;
    }
    return values;
  };
  MachineTemperature temperature;
  temperature.axes = axes_;
  temperature.axis_motor = kelvin(AXIS_MOTOR, -1, axes_.size());
  temperature.axis_encoder = kelvin(AXIS_ENCODER, -1, axes_.size());
  temperature.spindle_motor = kelvin(SPINDLE_MOTOR, parameters_.spindle, 1).front();
  if (!any) {
    throw FocasError(refused, focas::EW_NUMBER);
  }
  return temperature;
}

void FocasReader::readState(const std::vector<SubReply>& replies, std::size_t axes, Reading& reading) {
  const PollRequests& q = *poll_requests_;
  focas::Reader reader(replies[q.status].data);
  const focas::Status status = focas::decodeStatus(reader);
  CncState& state = reading.state;
  state.mode = modeOf(status.aut);
  state.run = static_cast<CncRun>(std::clamp<std::int16_t>(status.run, focas::RUN_RESET, focas::RUN_START));
  state.motion = status.motion == focas::MOTION_MOVES;
  reading.at_rest = status.motion == focas::MOTION_NONE;
  state.emergency = status.emergency != 0;
  state.alarm = status.alarm == 1;
  state.program = firstInteger(replies[q.program]);
  state.sequence = firstInteger(replies[q.sequence]);
  state.feed = firstValue(replies[q.feed]) * units::MM / 60.0;
  state.spindle_speed = units::radPerSecFromRpm(firstValue(replies[q.speed]));
  state.axes = focas::decodeNames(replies[q.axis_names], axes);
  for (std::size_t i = state.axes.size(); i < axes; ++i) {
    state.axes.push_back(i < 3 ? std::string(1, "XYZ"[i]) : "A" + std::to_string(i + 1));
  }
}

void FocasReader::readPositions(const std::vector<SubReply>& replies, std::size_t axes, Reading& reading) {
  const PollRequests& q = *poll_requests_;
  CncState& state = reading.state;
  state.position = lengths(replies[q.machine], axes);
  state.distance_to_go = lengths(replies[q.distance], axes);
  reading.absolute = lengths(replies[q.absolute], axes);
  if (reading.absolute.empty()) {
    reading.absolute = state.position;
  }
  for (const std::vector<double>* values : {&state.position, &state.distance_to_go, &reading.absolute}) {
    if (values->size() != axes) {
      throw FocasError("the controller reports positions of fewer axes than it has", focas::EW_LENGTH);
    }
  }
  decimals_ = decimalsOf(replies[q.machine]);
}

void FocasReader::readAlarms(std::uint32_t bits, CncState& state) {
  if (!state.alarm && bits == 0) {
    alarm_text_.clear();
    alarms_.clear();
    alarm_bits_ = 0;
  } else if (bits != alarm_bits_ || alarm_text_.empty()) {
    alarm_bits_ = bits;
    alarm_text_.clear();
    alarms_.clear();
    try {
      for (const focas::AlarmMessage& alarm : client_.alarmMessages()) {
        alarms_.push_back({alarm.number, alarm.type, alarm.axis, alarm.text});
        alarm_text_ += (alarm_text_.empty() ? "" : "; ") + std::to_string(alarm.number) +
                       (alarm.text.empty() ? "" : " " + alarm.text);
      }
    } catch (const FocasError&) {
      if (!client_.connected()) {
        throw;
      }
      // Without messages the alarm bits are reported below.
    }
    if (alarm_text_.empty()) {
      alarm_text_ = "alarm bits " + std::to_string(bits);
    }
  }
  state.alarm_text = alarm_text_;
}

void FocasReader::readLoad(const std::vector<SubReply>& replies, std::size_t axes, Reading& reading) const {
  const PollRequests& q = *poll_requests_;
  const std::size_t spindle = static_cast<std::size_t>(parameters_.spindle - 1);
  const std::vector<double> load = focas::decodeValues(replies[q.spindle_load], spindle + 1);
  const std::vector<double> speed = focas::decodeValues(replies[q.spindle_speed], spindle + 1);
  if (load.size() <= spindle) {
    return;
  }
  LoadSample sample;
  sample.spindle_load = load[spindle] / 100.0;
  sample.spindle_speed =
      speed.size() > spindle ? units::radPerSecFromRpm(speed[spindle]) : reading.state.spindle_speed;
  sample.axes = reading.state.axes;
  sample.axis_load = focas::decodeValues(replies[q.axis_load], axes);
  for (double& value : sample.axis_load) {
    value = std::abs(value) / 100.0;
  }
  sample.axis_load.resize(axes, std::numeric_limits<double>::quiet_NaN());
  reading.load = std::move(sample);
}

}  // namespace smartmill::cnc
