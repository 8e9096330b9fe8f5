#pragma once

#include <array>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "smartmill_core/cutting/tool.h"
#include "smartmill_core/model/machine_model.h"
#include "smartmill_core/parameters/parameter_table.h"
#include "smartmill_core/units.h"
#include "smartmill_program/engagement/cut_simulation.h"
#include "smartmill_program/live/path_piece.h"
#include "smartmill_program/live/program_path.h"
#include "smartmill_program/prediction/tool_models.h"
#include "smartmill_program/stock/stock.h"

namespace smartmill::program {

/// Part of a program in which the load of the spindle is constant: a level cut along a line or around a
/// circle with one arc of contact, or moves and dwells in air while the spindle turns.
struct SteadyStretch {
  bool cut = false;
  bool turns = false;                         ///< a cut along arcs of one circle
  double begin = 0.0, end = 0.0;              ///< [m] places on the path between which the load is constant
  double steady_from = 0.0, steady_to = 0.0;  ///< [m] the same without the margins
  nc::PathSegment::Point from{}, to{};        ///< [m] of a cut: tool tip at steady_from and steady_to
  std::size_t move = 0;                       ///< first move
  int part = 1;                               ///< number among the stretches of the same line
  int tool = 0;                               ///< T
  Engagement engagement;                      ///< of a cut, with the programmed feed
  double feed = 0.0;                          ///< [m/s] of a cut, programmed
  double spindle_speed = 0.0;                 ///< [rad/s] programmed
  double time = 0.0;                          ///< [s] between begin and end at the programmed feed
};

struct StretchParameters {
  double angle_tolerance = 0.0175;
  double depth_tolerance = 0.02;
  double margin_time = 0.1;
  double least_time = 0.7;

  void declare(ParameterTable& table) {
    table.number("angle_tolerance", angle_tolerance, "rad", Range::openLow(0.0, 0.2),
                 "range of entry and exit angle within a steady cut");
    table.number("depth_tolerance", depth_tolerance, "1", Range::openLow(0.0, 0.2),
                 "range of the axial depth within a steady cut, relative to it");
    table.number("margin_time", margin_time, "s", Range::closed(0.0, 10.0),
                 "time at the programmed feed at both ends of constant engagement that is not steady: period "
                 "and delay of the controller's states; at least a revolution");
    table.number("least_time", least_time, "s", Range::positive(),
                 "shortest constant engagement or air that makes a condition: margins, settling of the load "
                 "meter and ten of its readings");
  }
};

/// A program with its path, where it cuts, and its steady stretches.
struct LiveProgram {
  struct Interval {
    double from, to;  // [m] places on the path
  };
  std::string name;  ///< for the names of conditions
  ProgramPath path;
  std::vector<SteadyStretch> stretches;  ///< in ascending order
  std::vector<Interval> contact;         ///< where material is removed, in ascending order
  std::vector<PathPiece> pieces;         ///< in ascending order
  std::map<int, ToolGeometry> tools;     ///< by T, of the stretches and of all that cut

  /// Whether material is removed between two places [m].
  bool cutsBetween(double from, double to) const { return contactBetween(from, to) > 0.0; }
  /// [m] Length of the path between two places [m] on which material is removed.
  double contactBetween(double from, double to) const;
  /// Of the pieces between two places [m] that cut: least entry, largest exit and depth, without feed; empty:
  /// none cuts.
  std::optional<Engagement> enclosingEngagement(double from, double to) const;
};

/// The workpiece of a model in the coordinates of a program. @param zero [m] machine position at which the
/// tip of the tool is at the program's zero
StockBlock stockBlock(const Workpiece& workpiece, const std::array<double, 3>& zero);

/// Runs a program through its stock. @param name of the program, for messages
/// @throws Error as ProgramAnalysis::run, and on a rapid move that meets the stock
LiveProgram prepareProgram(const std::string& name, std::vector<Move> moves, ToolModels& tools, Stock& stock,
                           const SimulationOptions& simulation, const StretchParameters& parameters);

}  // namespace smartmill::program
