#include "smartmill_program/report/program_page.h"

#include <algorithm>
#include <cmath>

#include "smartmill_core/formatted.h"
#include "smartmill_core/units.h"

namespace smartmill::program {
namespace {

using units::degFromRad;
using units::MM;

constexpr std::size_t MOST_ROWS =
    2000;  // a page of 0.3 MB that a browser sorts at once; all rows are in blocks.csv

}  // namespace

ReportPage programPage(const std::string& program, const std::string& summary,
                       const std::vector<std::string>& remarks, const PathView& path,
                       const std::vector<BlockSummary>& blocks) {
  ReportPage page(program);
  page.html() << "<pre class=\"verdict\" style=\"font-size:15px\">" << escapedHtml(summary) << "</pre>\n";
  if (!remarks.empty()) {
    page.html() << "<h2>What should be changed</h2>\n<ul>\n";
    for (const std::string& remark : remarks) page.html() << "<li>" << escapedHtml(remark) << "</li>\n";
    page.html() << "</ul>\n";
  }
  path.write(page.html());
  page.html() << "<h2>Blocks</h2>\n";
  if (blocks.size() > MOST_ROWS)
    page.html() << "<p>The first " << MOST_ROWS << " of " << blocks.size()
                << " blocks; all are in blocks.csv.</p>\n";
  page.html()
      << "<table><tr><th>line<th>name<th>operation<th>tool<th>time [s]<th>axial depth [mm]<th>radial depth "
         "[mm]"
         "<th>entry [deg]<th>exit [deg]<th>feed per tooth [mm]<th>volume [mm3]<th>peak force [N]"
         "<th>peak torque [N m]<th>power [W]<th>chip thickness [mm]<th>tip deflection [um]<th>stability "
         "margin<th>air [%]</tr>\n";
  const auto cell = [&](double value, const char* format) {
    page.html() << "<td>";
    if (!std::isnan(value)) page.html() << formatted(format, value);
  };
  for (std::size_t i = 0; i < std::min(blocks.size(), MOST_ROWS); ++i) {
    const BlockSummary& b = blocks[i];
    page.html() << "<tr><td>" << b.line << "<td>" << (b.name ? escapedHtml(*b.name) : "") << "<td>"
                << escapedHtml(b.operation)
                << (b.rapid_hit    ? " hits the stock"
                    : b.holder_hit ? " holder hits the stock"
                                   : "")
                << "<td>" << b.tool;
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
    cell(b.chip / MM, "%.4f");
    cell(b.deflection / units::UM, "%.1f");
    cell(b.margin, "%.2f");
    cell(100.0 * b.airShare(), "%.0f");
    page.html() << "</tr>\n";
  }
  page.html() << "</table>\n";
  return page;
}

}  // namespace smartmill::program
