#pragma once

#include <string>
#include <vector>

#include "smartmill_core/io/report_page.h"
#include "smartmill_program/report/block_summary.h"
#include "smartmill_program/stock/dexel_grid.h"

namespace smartmill::program {

/// Quantity that colours the tool path of the page.
enum class Colour { force, torque, power, axial_depth, immersion, margin };
/// @throws Error naming the known ones
Colour colourOf(const std::string& name);
/// Words of colourOf().
const std::vector<std::string>& colourNames();

/// Tool path from above, coloured by a quantity. Successive steps of one colour are one line.
class PathPicture {
 public:
  PathPicture(const StockBlock& block, Colour colour) : block_(block), colour_(colour) {}

  void add(const Step& step, const StepPrediction& prediction);
  /// The picture as SVG with its scale.
  std::string svg() const;

 private:
  struct Piece {
    std::array<float, 4> ends;  // [m] x, y of start and end
    float value;                // NaN: air
  };
  StockBlock block_;
  Colour colour_;
  std::vector<Piece> pieces_;
};

/// The page: picture, summary and the table of the blocks.
ReportPage programPage(const std::string& program, const std::string& summary, const PathPicture& picture,
                       const std::vector<BlockSummary>& blocks);

}  // namespace smartmill::program
