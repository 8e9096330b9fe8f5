#pragma once

#include <optional>
#include <vector>

#include "smartmill_core/cutting/tool.h"
#include "smartmill_core/signal/streams.h"
#include "smartmill_program/engagement/cut_simulation.h"
#include "smartmill_program/prediction/tool_models.h"

namespace smartmill::program {

/// A piece of the path within one move, along which the engagement is constant.
struct PathPiece {
  enum class Kind { rapid, air, cut };

  double from = 0.0, to = 0.0;            ///< [m] places on the path
  nc::PathSegment::Point begin{}, end{};  ///< [m] tool tip
  int line = 0;                           ///< of the program
  Kind kind = Kind::air;
  int tool = 0;                 ///< T
  Contact contact;              ///< of a cut, at its begin
  double feed_per_tooth = 0.0;  ///< [m] of a cut, horizontal
  double feed_angle = 0.0;      ///< [rad] as in Step
  bool left_hand = false;       ///< M4
  double spindle_speed = 0.0;   ///< [rad/s]
};

/// What is predicted of a piece; NaN: nothing.
struct PiecePrediction {
  double peak_force = NOT_A_NUMBER;  ///< [N] largest force across the tool axis over a revolution
  double margin = NOT_A_NUMBER;      ///< [1] stability limit of the axial depth over the axial depth
};

/// Tolerances within which the engagement counts as constant.
struct PieceTolerance {
  double angle;  ///< [rad] of entry and exit
  double depth;  ///< [1] of the axial depth
};

/// Joins the steps of a program to pieces.
class PieceMaker {
 public:
  PieceMaker(ToolModels& tools, const PieceTolerance& tolerance) : tools_(tools), tolerance_(tolerance) {}

  /// @param place [m] of the step's begin
  void add(const Step& step, double place);
  std::vector<PathPiece> take() { return std::move(pieces_); }

 private:
  bool continues(const Step& step, double place) const;

  ToolModels& tools_;
  PieceTolerance tolerance_;
  std::vector<PathPiece> pieces_;
  const Move* move_ = nullptr;
};

/// Predicts every piece, by the models of its tools.
/// @param coefficients of all tools in place of those of the models
/// @return one for each piece; without coefficients of its tool a piece is not predicted
std::vector<PiecePrediction> predictPieces(const std::vector<PathPiece>& pieces, ToolModels tools,
                                           const std::optional<CuttingCoefficients>& coefficients);

}  // namespace smartmill::program
