#pragma once

#include <cstddef>
#include <functional>
#include <string>
#include <vector>

#include "smartmill_program/engagement/contact.h"
#include "smartmill_program/nc/move.h"
#include "smartmill_program/stock/stock.h"
#include "smartmill_program/stock/tool_shape.h"

namespace smartmill::program {

/// The tool over a short part of a move; quantities are those at its middle.
struct Step {
  const Move* move = nullptr;
  nc::PathSegment::Point start{}, tip{}, end{};  ///< [m] at both ends and in the middle
  double length = 0.0;                           ///< [m]
  double time = 0.0;                             ///< [s]
  double feed_angle = 0.0;  ///< [rad] of the horizontal feed direction from +x of the machine
  double feed_share = 0.0;  ///< [1] horizontal part of the feed: 1 level, 0 along the tool axis
  Contact contact;          ///< of the edges with the horizontal feed
  double side_volume = 0.0, face_volume = 0.0;  ///< [m3] removed by the feed across and along the tool axis
  bool holder_hit = false;                      ///< whether the holder meets material

  double volume() const { return side_volume + face_volume; }
  bool air() const { return volume() <= 0.0; }
};

struct SimulationOptions {
  /// [1] Length of a step per tool radius. The volume is integrated by the midpoint rule; where the tool
  /// crosses an edge of the material its width begins like a square root, 2 sqrt(2 R s), with an error of at
  /// most 0.208 (zeta(-1/2)) x 2 sqrt(2 R) h^1.5 = 0.0092 R^2 per depth.
  double step_share = 1.0 / 16.0;
  double rapid = 0.0;  ///< [m/s] rapid feed, for times; 0: rapid moves take no time
};

/// Runs moves through a stock, step by step.
class CutSimulation {
 public:
  /// Shape of a tool by its number. May throw.
  using Tool = std::function<const ToolShape&(int tool)>;
  /// Called after each step. @return false: the simulation ends.
  using Visit = std::function<bool(const Step&)>;

  CutSimulation(Stock& stock, const Tool& tool, const SimulationOptions& options = {});

  /// Arcs in G18 and G19 are replaced by chords within a micrometre.
  /// @return false when the visitor ended it. @throws Error on a cut with the spindle at rest
  bool run(const Move& move, const Visit& visit);

 private:
  bool runPath(const Move& move, const nc::PathSegment& path, const Visit& visit);
  Step step(const Move& move, double from, double to, const ToolShape& tool);

  Stock& stock_;
  Tool tool_;
  SimulationOptions options_;
};

}  // namespace smartmill::program
