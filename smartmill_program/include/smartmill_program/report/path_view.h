#pragma once

#include <array>
#include <ostream>
#include <string>
#include <vector>

#include "smartmill_program/engagement/cut_simulation.h"
#include "smartmill_program/prediction/step_predictor.h"
#include "smartmill_program/stock/stock_shape.h"

namespace smartmill::program {

/// Quantities that colour the tool path: words of the command line and their titles with unit.
const std::vector<std::string>& colourNames();

/// Tool path in space, coloured by a quantity that the reader chooses: dragging turns it, the wheel zooms,
/// the pointer reads line and value. Successive steps of a straight move with the same values are one piece.
class PathView {
 public:
  static constexpr std::size_t QUANTITIES = 10;

  /// @param colour shown first. @throws Error naming the known ones
  PathView(const StockBlock& block, const std::string& colour);

  void add(const Step& step, const StepPrediction& prediction);
  /// Writes the picture as HTML with its script.
  void write(std::ostream& html) const;

 private:
  struct Piece {
    int line = 0;
    const Move* move = nullptr;
    nc::PathSegment::Point start{}, end{};   // [m]
    std::array<double, QUANTITIES> value{};  // NaN: none
  };
  bool continues(const Piece& piece) const;

  StockBlock block_;
  std::size_t first_;
  std::vector<Piece> pieces_;
};

}  // namespace smartmill::program
