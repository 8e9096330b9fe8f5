#pragma once

#include <array>
#include <string>

#include "smartmill_core/parameters/parameter_table.h"

namespace smartmill::cnc {

/// What the machine may do; every block is checked against it before anything is sent.
struct MotionLimits {
  std::array<std::array<double, 2>, 3> travel{};  ///< [m] lowest and highest machine position of x, y, z
  double max_feed = 0.0;
  double max_spindle_speed = 0.0;
  double max_dwell = 60.0;
  double max_jog = 0.1;
  double min_feed_override = 0.3, max_feed_override = 1.2;
  double min_spindle_override = 0.5, max_spindle_override = 1.2;

  /// Without the travel.
  void declare(ParameterTable& table) {
    table.number("max_feed", max_feed, "m/s", Range::notNegative(), "0: the model's");
    table.number("max_spindle_speed", max_spindle_speed, "rad/s", Range::notNegative(), "0: the model's");
    table.number("max_dwell", max_dwell, "s", Range::positive(), "of one G4");
    table.number("max_jog", max_jog, "m", Range::positive(), "of one jog");
    table.number("min_feed_override", min_feed_override, "1", Range::closed(0.01, 1.0),
                 "least override of the feed that is passed on");
    table.number("max_feed_override", max_feed_override, "1", Range::closed(1.0, 2.0), "the largest");
    table.number("min_spindle_override", min_spindle_override, "1", Range::closed(0.1, 1.0),
                 "least override of the spindle");
    table.number("max_spindle_override", max_spindle_override, "1", Range::closed(1.0, 2.0), "the largest");
  }
  /// @throws Error naming key and value.
  void validate() const;
};

/// Where a program starts.
struct StartPosition {
  std::array<double, 3> machine{{0, 0, 0}};  ///< [m]
  std::array<double, 3> absolute{
      {0, 0, 0}};  ///< [m] the same place in the workpiece coordinates that G90 means
};

/// What the bridge writes between the lines of a program.
struct DialectOptions {
  int marker_macro = 100;  ///< number of the variable that tells the end; a program must leave it alone
  int decimals = 3;        ///< of lengths in mm, as the controller's increment system has them
};

enum class NcVerdict { good, not_understood, outside_limits };

struct NcCheck {
  NcVerdict verdict = NcVerdict::good;
  std::string message;                   ///< one line naming the program's line, empty when good
  std::string text;                      ///< what to send: one block a line, LF at each end
  std::array<double, 3> end{{0, 0, 0}};  ///< [m] machine position at the end
};

/// Reads a program of the dialect (mm, mm/min, rpm): N; G0 G1 G4 (P ms or X s) G90 G91; X Y Z F S; M3 M5 M30
/// M2 M119; #n=value; comments in parentheses. A program begins in G90 with no G0, G1 and F in force (the
/// text says so to the controller); from there every position is followed. M30 and M2 end it: they become M5,
/// because the DNC session goes on. Lengths are written with a decimal point, since a control may take X10
/// for 10 um.
NcCheck checkProgram(const std::string& program, const StartPosition& start, const MotionLimits& limits,
                     const DialectOptions& options);

/// One block that moves an axis by a distance. @param axis 0 x, 1 y, 2 z. @param distance [m]. @param feed
/// [m/s], 0: G0.
std::string jogProgram(int axis, double distance, double feed, int decimals);

/// @param angle [rad] of tooth 1. @return #macro=n (0..4095 for 0..2 pi), M119 (Dunwoody 6.2).
std::string orientProgram(double angle, int macro);

/// Fixed decimals, "-0.000" as "0.000".
std::string fixedDecimals(double value, int decimals);

}  // namespace smartmill::cnc
