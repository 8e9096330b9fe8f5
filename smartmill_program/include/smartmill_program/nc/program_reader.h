#pragma once

#include <array>
#include <functional>
#include <map>
#include <string>
#include <vector>

#include "smartmill_program/nc/move.h"

namespace smartmill::program {

struct ReaderOptions {
  /// [m] "G54" .. "G59", "G59.1" .. "G59.3", "G54.1P1" ..: position of its zero in the coordinates of the
  /// stock. The first work offset of a program that is not listed is that of the stock; any other has to be
  /// listed.
  std::map<std::string, std::array<double, 3>> work_offsets;
  /// [m] >= 0, D of G41 and G42; D0 is 0, any other that is not listed is the radius of the tool.
  std::map<int, double> radius_offsets;
  std::function<double(int tool)> tool_radius;  ///< [m] by the tool number. May throw; empty: unknown
};

/// The moves of a program in the order of execution. Dialect: Fanuc 30i with decimal point input (parameter
/// 3401#0) and what LinuxCNC shares with it; docs/nc_program.md lists the words. z is the tool tip (G43). The
/// position is unknown at the start and after G28 and G53, so the rapid move from there is not part of the
/// result.
/// @throws Error "FILE: line N, column C: ..." for any word that is not supported, and for programs that end
/// early.
std::vector<Move> readProgram(const std::string& file, const ReaderOptions& options = {});

/// The same of a text. @param name for messages
std::vector<Move> interpretProgram(const std::string& text, const std::string& name,
                                   const ReaderOptions& options = {});

}  // namespace smartmill::program
