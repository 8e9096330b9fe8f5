#include "data_calls.h"

#include <algorithm>
#include <cstdint>

namespace smartmill::focas {
namespace {

constexpr std::size_t NAME_WIDTH = 4;      // [byte]
constexpr std::size_t PATH_WIDTH = 256;    // [byte]
constexpr std::size_t PROGRAM_WIDTH = 36;  // [byte]
constexpr int MAX_BLOCK_TEXT = 4096;       // [byte]
constexpr int MAX_MESSAGE_TEXT = 256;      // [byte]
constexpr std::uint32_t DISPLAYED = 7;     // disp flags of a displayed axis
constexpr int UNIT_MM_PER_MIN = 3;         // unit codes of rdspeed: the unit is the code - 3
constexpr int UNIT_RPM = 5;

/// All values, or exactly one of them. @param index 1-based, -1 or 0 all.
int writeSelected(const std::vector<double>& values, int index, int decimals, int out_of_range, Writer& out) {
  if (index == -1 || index == 0) {
    for (double value : values) {
      out.value8(Value8::fromDouble(value, decimals));
    }
    return EW_OK;
  }
  if (index < 1 || index > static_cast<int>(values.size())) {
    return out_of_range;
  }
  out.value8(Value8::fromDouble(values[static_cast<std::size_t>(index - 1)], decimals));
  return EW_OK;
}

}  // namespace

SubReply DataCalls::answer(const SubRequest& request) {
  SubReply reply;
  reply.c1 = request.c1;
  reply.c2 = request.c2;
  reply.c3 = request.c3;
  Writer out;
  int code = EW_FUNC;
  try {
    if (request.c1 != 1 && request.c1 != 2) {
      code = EW_FUNC;
    } else if (request.c2 != 1) {
      code = EW_PATH;
    } else if (const std::optional<int> memory_code = memory_.call(request, out)) {
      code = *memory_code;
    } else if (const std::optional<int> macro_code = macros_.call(request, out)) {
      code = *macro_code;
    } else {
      code = call(request, out);
    }
  } catch (const WireError&) {
    code = EW_LENGTH;
  } catch (const std::exception&) {
    code = EW_SYSTEM;
  }
  reply.code = static_cast<std::int16_t>(code);
  if (code == EW_OK) {
    reply.data = out.data();
  }
  return reply;
}

int DataCalls::call(const SubRequest& request, Writer& out) {
  switch (request.c3) {
    case OP_START:
      return controller_.cycleStart();
    case OP_RESET:
      return controller_.reset();
    case OP_SPINDLE:
      return spindle(request, out);
    case OP_SERVO:
      return servo(request, out);
    case OP_POSITION:
      return position(request, out);
    case OP_SPINDLE_NAMES:
      return spindleNames(request, out);
    case OP_ALARM_MESSAGES:
      return alarmMessages(request, out);
    default:
      return answerState(request, out) || answerProgram(request, out) || answerMachine(request, out)
                 ? EW_OK
                 : EW_FUNC;
  }
}

/// State of the controller. @return whether it is such a request
bool DataCalls::answerState(const SubRequest& request, Writer& out) const {
  switch (request.c3) {
    case OP_STATUS:
      status(controller_.status(), out);
      return true;
    case OP_STATUS2:
      // ODBST2 without hdck and tmmode, which have separate requests: the seven values of statinfo, then
      // warning, o3dchk, ext_opt and restart.
      status(controller_.status(), out);
      out.zeros(8);
      return true;
    case OP_HDCK:
      out.i16(controller_.status().hdck);
      return true;
    case OP_TMMODE:
      out.i16(controller_.status().tmmode);
      return true;
    case OP_OPERATION_MODE:
      out.i16(controller_.status().aut);
      return true;
    case OP_ACTUAL_FEED:
      out.value8(Value8::fromDouble(controller_.actualFeed(), 0));
      return true;
    case OP_ACTUAL_SPEED: {
      const std::vector<double> speeds = controller_.spindleSpeed();
      out.value8(Value8::fromDouble(speeds.empty() ? 0.0 : speeds.front(), 0));
      return true;
    }
    case OP_ALARM:
      out.u32(controller_.alarmBits());
      return true;
    case OP_DNC_DIAGNOSIS:
      out.i16(0).i16(0).text("", 16).zeros(10);
      return true;
    default:
      return false;
  }
}

/// The running program. @return whether it is such a request
bool DataCalls::answerProgram(const SubRequest& request, Writer& out) const {
  switch (request.c3) {
    case OP_PROGRAM_NUMBER:
      out.i32(controller_.runningProgram()).i32(controller_.mainProgram());
      return true;
    case OP_SEQUENCE_NUMBER:
      out.i32(controller_.sequenceNumber());
      return true;
    case OP_BLOCK_COUNT:
      out.i32(controller_.blockCount());
      return true;
    case OP_EXECUTING_PROGRAM: {
      const int number = controller_.runningProgram();
      out.i32(number).text("O" + std::to_string(number), PROGRAM_WIDTH);
      return true;
    }
    case OP_MAIN_PROGRAM:
      out.text(controller_.programPath(), PATH_WIDTH);
      return true;
    case OP_EXECUTING_BLOCK: {
      const std::string text = controller_.programText();
      const int max_size = std::clamp(request.v[0], 0, MAX_BLOCK_TEXT);
      out.i32(controller_.blockCount()).text(text, std::min(text.size(), static_cast<std::size_t>(max_size)));
      return true;
    }
    default:
      return false;
  }
}

/// Axes, spindles and versions of the controller. @return whether it is such a request
bool DataCalls::answerMachine(const SubRequest& request, Writer& out) const {
  switch (request.c3) {
    case OP_SYSTEM_INFO: {
      const std::size_t axes = info_.axes.size();
      const std::string count = (axes < 10 ? "0" : "") + std::to_string(axes);
      out.u16(2).u16(32).text(info_.cnc_type, 2, ' ').text(info_.mt_type, 2, ' ');
      out.text(info_.series, 4, ' ').text(info_.version, 4, ' ').text(count, 2, ' ');
      return true;
    }
    case OP_LOCK:
      // a4 encloses calls that read several values and returns the number of elements: 1 spindles, 3 rdspeed.
      out.i16(static_cast<std::int16_t>(request.v[0] == 1   ? info_.spindles.size()
                                        : request.v[0] == 3 ? 1
                                                            : info_.axes.size()));
      return true;
    case OP_AXIS_NAMES:
      axisNames(request, out);
      return true;
    case OP_UNITS:
      units(request, out);
      return true;
    case OP_DISPLAY_FLAGS:
      for (std::size_t i = 0; i < info_.axes.size(); ++i) {
        out.u32(DISPLAYED);
      }
      return true;
    case OP_CNC_ID:
      for (std::uint32_t word : info_.cnc_id) {
        out.u32(word);
      }
      return true;
    default:
      return false;
  }
}

int DataCalls::spindleNames(const SubRequest& request, Writer& out) const {
  if (request.v[0] > static_cast<int>(info_.spindles.size())) {
    return EW_NUMBER;
  }
  for (std::size_t i = 0; i < info_.spindles.size(); ++i) {
    if (request.v[0] < 1 || request.v[0] == static_cast<int>(i) + 1) {
      out.text(info_.spindles[i], NAME_WIDTH);
    }
  }
  return EW_OK;
}

void DataCalls::status(const Status& s, Writer& out) const {
  out.i16(s.aut).i16(s.run).i16(s.motion).i16(s.mstb).i16(s.emergency).i16(s.alarm).i16(s.edit);
}

int DataCalls::position(const SubRequest& request, Writer& out) const {
  std::vector<double> values;
  switch (request.v[0]) {
    case RDPOSITION_ABSOLUTE:
    case POSITION_ABSOLUTE:
    case POSITION_SKIP:
      values = controller_.absolutePosition();
      break;
    case POSITION_MACHINE:
      values = controller_.machinePosition();
      break;
    case RDPOSITION_RELATIVE:
    case POSITION_RELATIVE:
      values = controller_.relativePosition();
      break;
    case RDPOSITION_DISTANCE:
    case POSITION_DISTANCE:
      values = controller_.distanceToGo();
      break;
    case POSITION_SERVO_DELAY:
    case POSITION_ACCELERATION_DELAY:
      // The positions are those of an ideal servo without following error.
      break;
    default:
      return EW_NUMBER;
  }
  values.resize(info_.axes.size(), 0.0);
  return writeSelected(values, request.v[1], info_.position_decimals, EW_ATTRIB, out);
}

int DataCalls::spindle(const SubRequest& request, Writer& out) const {
  std::vector<double> values;
  int decimals = 0;
  switch (request.v[0]) {
    case SPINDLE_LOAD:
      values = controller_.spindleLoad();
      break;
    case SPINDLE_MAX_SPEED:
      values = controller_.spindleMaxSpeed();
      break;
    case SPINDLE_GEAR:
      values.assign(info_.spindles.size(), 1.0);
      break;
    case SPINDLE_SPEED:
    case SPINDLE_METER_SPEED:
      values = controller_.spindleSpeed();
      break;
    case SPINDLE_METER_LOAD:
      values = controller_.spindleLoad();
      decimals = info_.load_decimals;
      break;
    default:
      return EW_NUMBER;
  }
  values.resize(info_.spindles.size(), 0.0);
  return writeSelected(values, request.v[1], decimals, EW_NUMBER, out);
}

int DataCalls::servo(const SubRequest& request, Writer& out) const {
  std::vector<double> values;
  int decimals = 0;
  switch (request.v[0]) {
    case 0:
      values = controller_.servoLoopGain();
      break;
    case 1:
      values = controller_.servoLoad();
      decimals = info_.load_decimals;
      break;
    case 2:
      values = controller_.servoSpeed();
      break;
    case 3:
      values = controller_.servoCurrent();
      decimals = info_.current_decimals;
      break;
    default:
      return EW_NUMBER;
  }
  if (values.empty()) {
    return EW_FUNC;
  }
  values.resize(info_.axes.size(), 0.0);
  return writeSelected(values, -1, decimals, EW_ATTRIB, out);
}

void DataCalls::axisNames(const SubRequest& request, Writer& out) const {
  for (const std::string& name : info_.axes) {
    if (request.v[0] == -1) {
      // Of rdposition: names of the absolute and distance, machine and relative displays.
      out.zeros(NAME_WIDTH).text(name, NAME_WIDTH).text(name, NAME_WIDTH).text(name, NAME_WIDTH);
    } else {
      out.text(name, NAME_WIDTH);
    }
  }
}

void DataCalls::units(const SubRequest& request, Writer& out) const {
  if (request.v[0] == 3 || request.v[0] == 4) {
    out.i16(request.v[0] == 3 ? UNIT_MM_PER_MIN : UNIT_RPM).i16(0);
    return;
  }
  for (std::size_t i = 0; i < info_.axes.size(); ++i) {
    out.i16(0).i16(0);  // mm
  }
}

int DataCalls::alarmMessages(const SubRequest& request, Writer& out) const {
  const std::size_t width = static_cast<std::size_t>(std::clamp(request.v[3], 0, MAX_MESSAGE_TEXT));
  int remaining = request.v[1];
  for (const AlarmMessage& alarm : controller_.alarmMessages()) {
    if (remaining <= 0) {
      break;
    }
    if (request.v[0] != -1 && request.v[0] != alarm.type) {
      continue;
    }
    --remaining;
    out.i32(alarm.number).i32(alarm.type).i32(alarm.axis);
    out.i32(static_cast<std::int32_t>(std::min(alarm.text.size(), width))).text(alarm.text, width);
  }
  return EW_OK;
}

}  // namespace smartmill::focas
