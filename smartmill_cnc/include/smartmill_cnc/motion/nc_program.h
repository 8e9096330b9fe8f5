#pragma once

#include <array>
#include <string>

#include "smartmill_core/parameters/parameter_table.h"

namespace smartmill::cnc {

/// Limits of the machine; every block is checked against them before anything is sent.
struct MotionLimits {
  std::array<std::array<double, 2>, 3> travel{};  ///< [m] lowest and highest machine position of x, y, z
  double max_feed = 0.0;
  double max_spindle_speed = 0.0;
  double max_dwell = 60.0;
  double max_jog = 0.1;
  double min_feed_override = 0.3, max_feed_override = 1.2;
  double min_spindle_override = 0.5, max_spindle_override = 1.2;

  /// Without travel, a parameter of the node.
  void declare(ParameterTable& table) {
    table.number("max_feed", max_feed, "m/s", Range::notNegative(), "largest feed; 0: from the model");
    table.number("max_spindle_speed", max_spindle_speed, "rad/s", Range::notNegative(),
                 "largest spindle speed; 0: from the model");
    table.number("max_dwell", max_dwell, "s", Range::positive(), "longest dwell (G4)");
    table.number("max_jog", max_jog, "m", Range::positive(), "longest jog");
    table.number("min_feed_override", min_feed_override, "1", Range::closed(0.01, 1.0),
                 "smallest accepted feed override");
    table.number("max_feed_override", max_feed_override, "1", Range::closed(1.0, 2.0),
                 "largest accepted feed override");
    table.number("min_spindle_override", min_spindle_override, "1", Range::closed(0.1, 1.0),
                 "smallest accepted spindle override");
    table.number("max_spindle_override", max_spindle_override, "1", Range::closed(1.0, 2.0),
                 "largest accepted spindle override");
  }
  /// @throws Error naming key and value.
  void validate() const;
};

/// Position at the start of a program.
struct StartPosition {
  std::array<double, 3> machine{{0, 0, 0}};   ///< [m]
  std::array<double, 3> absolute{{0, 0, 0}};  ///< [m] same position in workpiece coordinates (G90)
};

/// Properties of the controller's dialect.
struct DialectOptions {
  int marker_macro = 100;  ///< variable that marks the end of a program; programs must not use it
  int decimals = 3;        ///< of lengths in mm, from the controller's increment system
};

enum class NcVerdict { good, not_understood, outside_limits };

struct NcCheck {
  NcVerdict verdict = NcVerdict::good;
  std::string message;                   ///< one line with the line number in the program; empty if good
  std::string text;                      ///< to be sent: one block per line, each ended by LF
  std::array<double, 3> end{{0, 0, 0}};  ///< [m] machine position at the end
};

/// Checks and translates a program of the bridge's dialect (mm, mm/min, rpm): N; G0 G1 G4 (P ms or X s) G90
/// G91; X Y Z F S; M3 M5 M30 M2 M119; #n=value; comments in parentheses. A program starts in G90 (the text
/// contains it) without a modal G0, G1 or F; every position is tracked from the start. M30 and M2 end the
/// program and become M5, because the DNC session continues. Lengths have a decimal point, since a control
/// may interpret X10 as 10 um.
NcCheck checkProgram(const std::string& program, const StartPosition& start, const MotionLimits& limits,
                     const DialectOptions& options);

/// @return one block that moves an axis by a distance. @param axis 0 x, 1 y, 2 z. @param distance [m].
/// @param feed [m/s], 0: G0.
std::string jogProgram(int axis, double distance, double feed, int decimals);

/// @param angle [rad] of tooth 1. @return #macro=n (0..4095 for 0..2 pi), M119 (Dunwoody 6.2).
std::string orientProgram(double angle, int macro);

/// Number with fixed decimals; "-0.000" becomes "0.000".
std::string fixedDecimals(double value, int decimals);

}  // namespace smartmill::cnc
