#pragma once

#include <array>
#include <optional>
#include <string>
#include <vector>

#include "smartmill_core/error.h"

namespace smartmill::sim {

/// A block that the control does not run; what() is the text of the alarm.
class NcAlarm : public Error {
 public:
  /// @param type bit of the alarm word. @param axis 1-based, 0: none.
  NcAlarm(int number, int type, const std::string& text, int axis = 0);
  int number() const { return number_; }
  int type() const { return type_; }
  int axis() const { return axis_; }

 private:
  int number_, type_, axis_;
};

/// Bits of the alarm word of a 30i.
enum AlarmType { ALARM_PS = 3, ALARM_OT = 4, ALARM_EX = 15 };

/// What one block says, in the units of the text; what it leaves out is empty.
struct NcBlock {
  std::optional<int> sequence;                ///< N
  std::optional<int> motion;                  ///< 0 G0, 1 G1
  std::optional<bool> relative;               ///< G91, G90
  std::optional<double> dwell;                ///< [s] G4
  std::array<std::optional<double>, 3> axis;  ///< [mm] X, Y, Z
  std::optional<double> feed;                 ///< [mm/min] F
  std::optional<double> speed;                ///< [rpm] S
  std::optional<int> m_code;                  ///< 2, 3, 5, 30 or 119
  std::optional<int> macro;                   ///< n of #n=value
  double macro_value = 0.0;

  bool moves() const { return axis[0] || axis[1] || axis[2]; }
};

/// Reads one line. Dialect: N; G0 G1 G4 (P in ms or X in s) G90 G91; X Y Z [mm] F [mm/min] S [rpm]; M2 M3 M5
/// M30 M119; or #n=value. Blanks, comments in parentheses and lines that begin with % mean nothing; a number
/// needs no decimal point. @throws NcAlarm (PS) for all else.
NcBlock parseBlock(const std::string& line);

}  // namespace smartmill::sim
