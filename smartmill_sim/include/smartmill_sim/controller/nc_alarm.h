#pragma once

#include <string>

#include "smartmill_core/error.h"

namespace smartmill::sim {

/// Bits of the alarm word of a 30i.
enum AlarmType { ALARM_PS = 3, ALARM_OT = 4, ALARM_EX = 15 };

// Numbers of alarms of a 30i.
constexpr int PS_TOO_MANY_DIGITS = 3;  ///< also of a block longer than the buffer
constexpr int PS_ILLEGAL_ADDRESS = 9;
constexpr int PS_IMPROPER_G = 10;
constexpr int PS_FEED_ZERO = 11;
constexpr int PS_ARC = 20;  ///< end point not on the arc
constexpr int PS_DIVIDED_BY_ZERO = 112;
constexpr int PS_MACRO_FORMAT = 114;
constexpr int PS_VARIABLE_NUMBER = 115;
constexpr int PS_VARIABLE_READ_ONLY = 116;
constexpr int PS_ILLEGAL_ARGUMENT = 119;
constexpr int OT_PLUS = 500;
constexpr int OT_MINUS = 501;
constexpr int EX_TOUCHED = 3001;  ///< stock, with the spindle at rest
constexpr int EX_PLUNGED = 3002;  ///< into the stock
constexpr int EX_COLLISION = 3003;

/// A block that the control refuses; what() is the text of the alarm.
class NcAlarm : public Error {
 public:
  /// @param type bit of the alarm word. @param axis 1-based, 0: none.
  NcAlarm(int number, int type, const std::string& text, int axis = 0)
      : Error(text), number_(number), type_(type), axis_(axis) {}
  /// A program alarm.
  NcAlarm(int number, const std::string& text) : NcAlarm(number, ALARM_PS, text) {}
  int number() const { return number_; }
  int type() const { return type_; }
  int axis() const { return axis_; }

 private:
  int number_, type_, axis_;
};

}  // namespace smartmill::sim
