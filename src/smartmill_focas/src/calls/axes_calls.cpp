// Positions, speeds and loads of axes and spindles.
#include <cstdint>
#include <vector>

#include "calls.h"

namespace smartmill::focas {
namespace {

constexpr std::size_t NAME_WIDTH = 4;   // [byte]
constexpr std::uint32_t DISPLAYED = 7;  // disp flags of a displayed axis
constexpr int UNIT_MM_PER_MIN = 3;      // unit codes of rdspeed: the unit is the code - 3
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

int position(const AxesInterface& axes, const SysInfo& info, const SubRequest& request, Writer& out) {
  std::vector<double> values;
  switch (request.v[0]) {
    case RDPOSITION_ABSOLUTE:
    case POSITION_ABSOLUTE:
    case POSITION_SKIP:
      values = axes.absolutePosition();
      break;
    case POSITION_MACHINE:
      values = axes.machinePosition();
      break;
    case RDPOSITION_RELATIVE:
    case POSITION_RELATIVE:
      values = axes.relativePosition();
      break;
    case RDPOSITION_DISTANCE:
    case POSITION_DISTANCE:
      values = axes.distanceToGo();
      break;
    case POSITION_SERVO_DELAY:
    case POSITION_ACCELERATION_DELAY:
      // The positions are those of an ideal servo without following error.
      break;
    default:
      return EW_NUMBER;
  }
  values.resize(info.axes.size(), 0.0);
  return writeSelected(values, request.v[1], info.position_decimals, EW_ATTRIB, out);
}

int spindle(const AxesInterface& axes, const SysInfo& info, const SubRequest& request, Writer& out) {
  std::vector<double> values;
  int decimals = 0;
  switch (request.v[0]) {
    case SPINDLE_LOAD:
      values = axes.spindleLoad();
      break;
    case SPINDLE_MAX_SPEED:
      values = axes.spindleMaxSpeed();
      break;
    case SPINDLE_GEAR:
      values.assign(info.spindles.size(), 1.0);
      break;
    case SPINDLE_SPEED:
    case SPINDLE_METER_SPEED:
      values = axes.spindleSpeed();
      break;
    case SPINDLE_METER_LOAD:
      values = axes.spindleLoad();
      decimals = info.load_decimals;
      break;
    default:
      return EW_NUMBER;
  }
  values.resize(info.spindles.size(), 0.0);
  return writeSelected(values, request.v[1], decimals, EW_NUMBER, out);
}

int servo(const AxesInterface& axes, const SysInfo& info, const SubRequest& request, Writer& out) {
  std::vector<double> values;
  int decimals = 0;
  switch (request.v[0]) {
    case 0:
      values = axes.servoLoopGain();
      break;
    case 1:
      values = axes.servoLoad();
      decimals = info.load_decimals;
      break;
    case 2:
      values = axes.servoSpeed();
      break;
    case 3:
      values = axes.servoCurrent();
      decimals = info.current_decimals;
      break;
    default:
      return EW_NUMBER;
  }
  if (values.empty()) {
    return EW_FUNC;
  }
  values.resize(info.axes.size(), 0.0);
  return writeSelected(values, -1, decimals, EW_ATTRIB, out);
}

int spindleNames(const SysInfo& info, const SubRequest& request, Writer& out) {
  if (request.v[0] > static_cast<int>(info.spindles.size())) {
    return EW_NUMBER;
  }
  for (std::size_t i = 0; i < info.spindles.size(); ++i) {
    if (request.v[0] < 1 || request.v[0] == static_cast<int>(i) + 1) {
      out.text(info.spindles[i], NAME_WIDTH);
    }
  }
  return EW_OK;
}

void putAxisNames(const SysInfo& info, const SubRequest& request, Writer& out) {
  for (const std::string& name : info.axes) {
    if (request.v[0] == -1) {
      // Of rdposition: names of the absolute and distance, machine and relative displays.
      out.zeros(NAME_WIDTH).text(name, NAME_WIDTH).text(name, NAME_WIDTH).text(name, NAME_WIDTH);
    } else {
      out.text(name, NAME_WIDTH);
    }
  }
}

void putUnits(const SysInfo& info, const SubRequest& request, Writer& out) {
  if (request.v[0] == 3 || request.v[0] == 4) {
    out.i16(request.v[0] == 3 ? UNIT_MM_PER_MIN : UNIT_RPM).i16(0);
    return;
  }
  for (std::size_t i = 0; i < info.axes.size(); ++i) {
    out.i16(0).i16(0);  // mm
  }
}

/// Lock encloses calls that read several values and returns the number of elements: 1 spindles, 3 rdspeed.
void putLock(const SysInfo& info, const SubRequest& request, Writer& out) {
  out.i16(static_cast<std::int16_t>(request.v[0] == 1   ? info.spindles.size()
                                    : request.v[0] == 3 ? 1
                                                        : info.axes.size()));
}

}  // namespace

void addAxesCalls(AxesInterface& axes, const SysInfo& info, CallTable& table) {
  table.add(OP_POSITION, [&](const SubRequest& r, Writer& out) { return position(axes, info, r, out); });
  table.add(OP_SPINDLE, [&](const SubRequest& r, Writer& out) { return spindle(axes, info, r, out); });
  table.add(OP_SERVO, [&](const SubRequest& r, Writer& out) { return servo(axes, info, r, out); });
  table.add(OP_SPINDLE_NAMES, [&](const SubRequest& r, Writer& out) { return spindleNames(info, r, out); });
  table.addReply(OP_AXIS_NAMES, [&](const SubRequest& r, Writer& out) { putAxisNames(info, r, out); });
  table.addReply(OP_UNITS, [&](const SubRequest& r, Writer& out) { putUnits(info, r, out); });
  table.addReply(OP_LOCK, [&](const SubRequest& r, Writer& out) { putLock(info, r, out); });
  table.addReply(OP_DISPLAY_FLAGS, [&](const SubRequest&, Writer& out) {
    for (std::size_t i = 0; i < info.axes.size(); ++i) {
      out.u32(DISPLAYED);
    }
  });
  table.addReply(OP_ACTUAL_FEED, [&](const SubRequest&, Writer& out) {
    out.value8(Value8::fromDouble(axes.actualFeed(), 0));
  });
  table.addReply(OP_ACTUAL_SPEED, [&](const SubRequest&, Writer& out) {
    const std::vector<double> speeds = axes.spindleSpeed();
    out.value8(Value8::fromDouble(speeds.empty() ? 0.0 : speeds.front(), 0));
  });
}

}  // namespace smartmill::focas
