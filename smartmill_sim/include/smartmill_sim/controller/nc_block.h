#pragma once

#include <array>
#include <optional>
#include <string>

#include "smartmill_core/nc/dialect.h"
#include "smartmill_sim/controller/nc_alarm.h"

namespace smartmill::sim {

/// Words of one block in the units of the text; empty: not in the block.
struct NcBlock {
  std::optional<int> program;                   ///< O
  std::optional<int> sequence;                  ///< N
  std::optional<int> motion;                    ///< 0 G0, 1 G1, 2 G2, 3 G3
  std::optional<bool> relative;                 ///< G91, G90
  std::optional<bool> inch;                     ///< G20, G21
  std::optional<bool> per_turn;                 ///< G95, G94
  std::optional<int> work;                      ///< 0..5 for G54..G59
  bool machine = false;                         ///< G53
  bool reference = false;                       ///< G28
  std::optional<double> dwell;                  ///< [s] G4
  std::array<std::optional<double>, 3> axis;    ///< X, Y, Z
  std::array<std::optional<double>, 2> centre;  ///< I, J relative to the start
  std::optional<double> radius;                 ///< R
  std::optional<double> feed;                   ///< F
  std::optional<double> speed;                  ///< [rpm] S
  std::optional<int> m_code;
  std::optional<int> tool;     ///< T
  bool length_offset = false;  ///< G43 H
  std::optional<int> macro;    ///< n of #n=value
  std::optional<double> macro_value;

  bool moves() const { return axis[0] || axis[1] || axis[2]; }
};

/// Value of a variable #n; nullopt: vacant. @throws NcAlarm if the variable does not exist.
using NcVariables = nc::Variables;

/// Parses one line. Dialect: O and N; G0 G1 G2 G3 (I J or R, plane G17) G4 (P in ms or X in s) G20 G21 G28
/// G40 G43 (H) G49 G53 G54..G59 G80 G90 G91 G94 G95; X Y Z F S T; M0..M9 M19 M30 M119; or #n=value. The
/// lengths of all tools are 0: positions are those of the tip. A value is a number,
/// which needs no decimal point, #n, or an expression in brackets with + - * / SIN COS SQRT (degrees); a word
/// with a vacant #n is ignored. Blanks, comments in parentheses and lines that begin with % are ignored.
/// @throws NcAlarm (PS) for everything else; the alarm names IF, WHILE and GOTO.
NcBlock parseBlock(const std::string& line, const NcVariables& variables = {});

}  // namespace smartmill::sim
