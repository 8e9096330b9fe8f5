#include "smartmill_program/report/program_page.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <sstream>

#include "smartmill_core/error.h"
#include "smartmill_core/formatted.h"
#include "smartmill_core/units.h"

namespace smartmill::program {
namespace {

using units::degFromRad;
using units::MM;

constexpr float NONE = std::numeric_limits<float>::quiet_NaN();
constexpr std::size_t MOST_ROWS =
    2000;  // a page of 0.3 MB that a browser sorts at once; all rows are in blocks.csv
constexpr double MOST_MARGIN = 3.0;  // [1] scale of the stability margin; a larger one has no consequence

/// From low to high: blue, green, yellow, red; in light and dark legible.
constexpr const char* COLOURS[] = {"#2c7bb6", "#00a6ca", "#00ccbc", "#5fc75f",
                                   "#b5c93b", "#f4b13c", "#ee6f3a", "#d7191c"};
constexpr int COUNT = 8;
constexpr const char* AIR = "#8896a4";

struct Quantity {
  const char* name;
  const char* title;
  bool reversed;  // low values are red
};
constexpr Quantity QUANTITIES[] = {
    {"force", "peak force [N]", false},      {"torque", "peak torque [N m]", false},
    {"power", "power [W]", false},           {"depth", "axial depth [mm]", false},
    {"immersion", "immersion [deg]", false}, {"margin", "stability limit / axial depth", true}};

const Quantity& quantityOf(Colour colour) {
  return QUANTITIES[static_cast<std::size_t>(colour)];
}

double valueOf(Colour colour, const Step& step, const StepPrediction& prediction) {
  switch (colour) {
    case Colour::force:
      return prediction.force.peak_force;
    case Colour::torque:
      return prediction.force.peak_torque;
    case Colour::power:
      return prediction.power;
    case Colour::axial_depth:
      return step.contact.axialDepth() / MM;
    case Colour::immersion:
      return degFromRad(step.contact.exit() - step.contact.entry());
    case Colour::margin:
      return std::min(prediction.limit / step.contact.axialDepth(), MOST_MARGIN);
  }
  return 0.0;
}

}  // namespace

const std::vector<std::string>& colourNames() {
  static const std::vector<std::string> names = [] {
    std::vector<std::string> all;
    for (const Quantity& quantity : QUANTITIES) all.emplace_back(quantity.name);
    return all;
  }();
  return names;
}

Colour colourOf(const std::string& name) {
  const auto& names = colourNames();
  const auto found = std::find(names.begin(), names.end(), name);
  if (found == names.end()) throw Error("colour " + name + ": expected " + joined(names));
  return static_cast<Colour>(found - names.begin());
}

void PathPicture::add(const Step& step, const StepPrediction& prediction) {
  if (step.move->rapid) return;
  const float value = step.contact.empty() ? NONE : static_cast<float>(valueOf(colour_, step, prediction));
  pieces_.push_back({{static_cast<float>(step.start[0]), static_cast<float>(step.start[1]),
                      static_cast<float>(step.end[0]), static_cast<float>(step.end[1])},
                     value});
}

std::string PathPicture::svg() const {
  double low = std::numeric_limits<double>::infinity(), high = -low;
  double left = block_.low[0], right = block_.high[0], bottom = block_.low[1], top = block_.high[1];
  for (const Piece& piece : pieces_) {
    if (std::isfinite(piece.value)) {
      low = std::min(low, static_cast<double>(piece.value));
      high = std::max(high, static_cast<double>(piece.value));
    }
    left = std::min<double>(left, std::min(piece.ends[0], piece.ends[2]));
    right = std::max<double>(right, std::max(piece.ends[0], piece.ends[2]));
    bottom = std::min<double>(bottom, std::min(piece.ends[1], piece.ends[3]));
    top = std::max<double>(top, std::max(piece.ends[1], piece.ends[3]));
  }
  const Quantity& quantity = quantityOf(colour_);
  // A constant quantity has the highest colour.
  const auto colour = [&](float value) -> const char* {
    if (!std::isfinite(value)) return AIR;
    const double share = high > low * (1.0 + 1e-6) ? (value - low) / (high - low) : 1.0;
    const int index = std::clamp(static_cast<int>(share * COUNT), 0, COUNT - 1);
    return COLOURS[quantity.reversed ? COUNT - 1 - index : index];
  };
  const double width = (right - left) / MM, height = (top - bottom) / MM,
               stroke = std::max(width, height) / 400.0;
  std::ostringstream out;
  out << formatted(
      "<figure><svg viewBox=\"%.3f %.3f %.3f %.3f\" style=\"width:100%%;max-height:70vh\" fill=\"none\" "
      "stroke-linecap=\"round\" stroke-linejoin=\"round\" stroke-width=\"%.3f\">\n",
      left / MM - 2 * stroke, -top / MM - 2 * stroke, width + 4 * stroke, height + 4 * stroke, stroke);
  out << formatted(
      "<rect x=\"%.3f\" y=\"%.3f\" width=\"%.3f\" height=\"%.3f\" stroke=\"#8896a4\" "
      "fill=\"#8896a422\"/>\n",
      block_.low[0] / MM, -block_.high[1] / MM, (block_.high[0] - block_.low[0]) / MM,
      (block_.high[1] - block_.low[1]) / MM);
  for (std::size_t i = 0; i < pieces_.size();) {
    const char* const stroke_colour = colour(pieces_[i].value);
    out << "<polyline stroke=\"" << stroke_colour << "\" points=\""
        << formatted("%.3f,%.3f", pieces_[i].ends[0] / MM, -pieces_[i].ends[1] / MM);
    std::size_t k = i;
    for (; k < pieces_.size() && colour(pieces_[k].value) == stroke_colour; ++k) {
      const bool follows = k == i || (pieces_[k].ends[0] == pieces_[k - 1].ends[2] &&
                                      pieces_[k].ends[1] == pieces_[k - 1].ends[3]);
      if (!follows) break;
      out << formatted(" %.3f,%.3f", pieces_[k].ends[2] / MM, -pieces_[k].ends[3] / MM);
    }
    out << "\"/>\n";
    i = k;
  }
  out << "</svg><figcaption>Tool path from above, x to the right; grey: air. Colour: " << quantity.title;
  if (low <= high) {
    out << ", " << formatted("%.4g", low) << " ";
    for (int i = 0; i < COUNT; ++i)
      out << "<span style=\"color:" << COLOURS[quantity.reversed ? COUNT - 1 - i : i] << "\">&#9632;</span>";
    out << " " << formatted("%.4g", high);
  }
  out << ".</figcaption></figure>\n";
  return out.str();
}

ReportPage programPage(const std::string& program, const std::string& summary, const PathPicture& picture,
                       const std::vector<BlockSummary>& blocks) {
  ReportPage page(program);
  page.html() << "<pre class=\"verdict\" style=\"font-size:15px\">" << escapedHtml(summary) << "</pre>\n"
              << picture.svg() << "<h2>Blocks</h2>\n";
  if (blocks.size() > MOST_ROWS)
    page.html() << "<p>The first " << MOST_ROWS << " of " << blocks.size()
                << " blocks; all are in blocks.csv.</p>\n";
  page.html()
      << "<table><tr><th>line<th>operation<th>tool<th>time [s]<th>axial depth [mm]<th>radial depth [mm]"
         "<th>entry [deg]<th>exit [deg]<th>feed per tooth [mm]<th>volume [mm3]<th>peak force [N]"
         "<th>peak torque [N m]<th>power [W]<th>stability margin<th>air [%]</tr>\n";
  const auto cell = [&](double value, const char* format) {
    page.html() << "<td>";
    if (!std::isnan(value)) page.html() << formatted(format, value);
  };
  for (std::size_t i = 0; i < std::min(blocks.size(), MOST_ROWS); ++i) {
    const BlockSummary& b = blocks[i];
    page.html() << "<tr><td>" << b.line << "<td>" << escapedHtml(b.operation)
                << (b.rapid_hit ? " hits the stock" : "") << "<td>" << b.tool;
    cell(b.time, "%.2f");
    cell(b.axial_depth / MM, "%.3f");
    cell(b.radial_depth / MM, "%.3f");
    cell(degFromRad(b.entry), "%.1f");
    cell(degFromRad(b.exit), "%.1f");
    cell(b.feed_per_tooth / MM, "%.4f");
    cell(b.volume / (MM * MM * MM), "%.1f");
    cell(b.peak_force, "%.0f");
    cell(b.peak_torque, "%.2f");
    cell(b.power, "%.0f");
    cell(b.margin, "%.2f");
    cell(100.0 * b.airShare(), "%.0f");
    page.html() << "</tr>\n";
  }
  page.html() << "</table>\n";
  return page;
}

}  // namespace smartmill::program
