#pragma once

#include <array>
#include <string>

#include "smartmill_cnc/motion/motion_limits.h"
#include "smartmill_core/nc/dialect.h"

namespace smartmill::cnc {

/// Dialect of the programs that the bridge accepts.
constexpr nc::Dialect BRIDGE_DIALECT{"NGXYZPFSM", " \t\r", true, false};

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
  std::string message;                   ///< "line 12, column 3: unknown word Q3, ..."; empty if good
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
