#pragma once

#include <string>
#include <vector>

#include "smartmill_core/units.h"
#include "smartmill_program/engagement/cut_simulation.h"
#include "smartmill_program/nc/program_reader.h"

namespace smartmill::program {

constexpr double MM3 = units::MM * units::MM * units::MM;
const StockBlock BLOCK{{0, 0, -10 * units::MM}, {60 * units::MM, 40 * units::MM, 0}};  // top at z = 0

/// A simulated program with one tool, and all of its steps.
struct SimulatedCut {
  SimulatedCut(const std::string& text, const ToolProfile& profile, const StockShape& shape,
               double resolution_mm)
      : tool(profile),
        stock(shape, resolution_mm * units::MM),
        whole(stock.columns().volume()),
        moves(interpretProgram("G21 G90 G17 S3000 M3 F600\n" + text + "M30\n", "part.nc")) {
    CutSimulation simulation(stock, [this](int) -> const ToolShape& { return tool; });
    for (const Move& move : moves) {
      simulation.run(move, [&](const Step& step) {
        steps.push_back(step);
        return true;
      });
    }
  }

  /// [mm3] @param line of the program; 0: all
  double volume(int line = 0) const {
    double sum = 0.0;
    for (const Step& step : steps)
      if (line == 0 || step.move->line == line) sum += step.volume() / MM3;
    return sum;
  }
  /// [mm3] removed from the columns
  double columnVolume() const { return (whole - stock.columns().volume()) / MM3; }

  ToolShape tool;
  Stock stock;
  double whole;  ///< [m3] of the columns at the start
  std::vector<Move> moves;
  std::vector<Step> steps;
};

}  // namespace smartmill::program
