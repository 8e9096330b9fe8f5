#include "smartmill_program/live/path_piece.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <memory>

#include "smartmill_core/units.h"
#include "smartmill_program/prediction/force_predictor.h"
#include "smartmill_program/prediction/stability_limits.h"

namespace smartmill::program {
namespace {

constexpr double ROUNDING = 1e-9;  // [m] of a place

bool alike(const Contact& a, const Contact& b, const PieceTolerance& tolerance) {
  return a.arcs.size() == b.arcs.size() &&
         std::equal(a.arcs.begin(), a.arcs.end(), b.arcs.begin(),
                    [&](const EngagedArc& one, const EngagedArc& other) {
                      return std::abs(one.entry - other.entry) <= tolerance.angle &&
                             std::abs(one.exit - other.exit) <= tolerance.angle &&
                             std::abs(one.top - other.top) <= tolerance.depth * one.depth();
                    });
}

PathPiece::Kind kindOf(const Step& step) {
  if (!step.air()) return PathPiece::Kind::cut;
  return step.move->rapid ? PathPiece::Kind::rapid : PathPiece::Kind::air;
}

/// Predictions of one tool.
struct OfTool {
  explicit OfTool(MachineModel machine)
      : model(std::move(machine)), force(*model.tool, *model.cutting), limits(model) {}

  PiecePrediction predict(const PathPiece& piece) {
    PiecePrediction prediction;
    prediction.peak_force = force.predict(piece.contact, piece.feed_per_tooth).peak_force;
    if (limits.available())
      prediction.margin =
          limits.limit(piece.contact, piece.feed_angle, piece.left_hand, piece.spindle_speed) /
          piece.contact.axialDepth();
    return prediction;
  }

  MachineModel model;
  ForcePredictor force;
  StabilityLimits limits;
};

}  // namespace

bool PieceMaker::continues(const Step& step, double place) const {
  if (pieces_.empty() || step.move != move_ || std::abs(pieces_.back().to - place) > ROUNDING) return false;
  const PathPiece& last = pieces_.back();
  // The pieces of an arc are its chords.
  return last.kind == kindOf(step) && !step.move->path.isArc() &&
         (last.kind != PathPiece::Kind::cut || alike(last.contact, step.contact, tolerance_));
}

void PieceMaker::add(const Step& step, double place) {
  if (continues(step, place)) {
    pieces_.back().to = place + step.length;
    pieces_.back().end = step.end;
    return;
  }
  move_ = step.move;
  PathPiece piece;
  piece.from = place;
  piece.to = place + step.length;
  piece.begin = step.start;
  piece.end = step.end;
  piece.line = step.move->line;
  piece.kind = kindOf(step);
  piece.tool = step.move->tool;
  if (piece.kind == PathPiece::Kind::cut) {
    piece.contact = step.contact;
    piece.feed_angle = step.feed_angle;
    piece.left_hand = step.move->left_hand;
    piece.spindle_speed = step.move->spindle_speed;
    piece.feed_per_tooth = units::TWO_PI * step.move->feed * step.feed_share /
                           (step.move->spindle_speed * tools_.of(piece.tool).tool->teeth);
  }
  pieces_.push_back(std::move(piece));
}

std::vector<PiecePrediction> predictPieces(const std::vector<PathPiece>& pieces, ToolModels tools,
                                           const std::optional<CuttingCoefficients>& coefficients) {
  std::map<int, std::unique_ptr<OfTool>> of_tools;  // null: no coefficients
  const auto of = [&](int tool) -> OfTool* {
    const auto known = of_tools.find(tool);
    if (known != of_tools.end()) return known->second.get();
    MachineModel model = tools.of(tool);
    if (coefficients) model.cutting = coefficients;
    std::unique_ptr<OfTool>& made = of_tools[tool];
    if (model.cutting) made = std::make_unique<OfTool>(std::move(model));
    return made.get();
  };
  std::vector<PiecePrediction> predictions(pieces.size());
  for (std::size_t k = 0; k < pieces.size(); ++k) {
    // The end face of the tool has no prediction.
    if (pieces[k].kind != PathPiece::Kind::cut || pieces[k].contact.empty()) continue;
    if (OfTool* tool = of(pieces[k].tool)) predictions[k] = tool->predict(pieces[k]);
  }
  return predictions;
}

}  // namespace smartmill::program
