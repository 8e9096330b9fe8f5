#include "gallery/page.h"

#include <sstream>
#include <tuple>

#include "smartmill_core/formatted.h"
#include "smartmill_core/io/report_page.h"

namespace smartmill::studies {
namespace {

/// On a phone a row is a block, with the column name before each cell.
constexpr const char* STYLE = R"(<style>
main a { color: var(--x); }
@media (max-width: 640px) {
  .table table, .table tbody, .table tr, .table td { display: block; }
  .table th { display: none; }
  .table td { border-top: 0; padding: 1px 0; }
  .table td:empty { display: none; }
  .table tr + tr { border-top: 1px solid var(--grid); padding: 8px 0; }
  .table td[data-name]::before { content: attr(data-name) ": "; color: var(--dim); }
}
</style>
)";

std::string cell(const std::string& text, const std::string& name = "") {
  return (name.empty() ? "<td>" : "<td data-name=\"" + name + "\">") + escapedHtml(text) + "</td>";
}

/// A row and its figure.
using FigureRow = std::pair<const Figure*, const Compared*>;

/// @param linked whether each row has a link to its figure
void table(ReportPage& page, const std::vector<FigureRow>& rows, bool linked) {
  if (rows.empty()) return;
  page.html() << "<table><tr>" << (linked ? "<th>figure</th>" : "")
              << "<th>number</th><th>document</th><th>here</th><th></th><th>why</th></tr>\n";
  for (const auto& [figure, row] : rows) {
    const char* style_class = row->verdict == Verdict::differs ? "bad" : "good";
    page.html() << "<tr>";
    if (linked) page.html() << "<td><a href=\"#" << figure->name << "\">" << figure->name << "</a></td>";
    page.html() << cell(row->what) << cell(row->seed, "document") << cell(row->ours, "here") << "<td class=\""
                << style_class << "\">" << nameOf(row->verdict) << "</td>"
                << (row->why.empty() ? "<td></td>" : cell(row->why, "why")) << "</tr>\n";
  }
  page.html() << "</table>\n";
}

std::vector<FigureRow> rowsOf(const std::vector<DrawnFigure>& drawn_figures, Verdict verdict) {
  std::vector<FigureRow> rows;
  for (const DrawnFigure& one : drawn_figures)
    for (const Compared& row : one.drawn.rows)
      if (row.verdict == verdict) rows.emplace_back(&one.figure, &row);
  return rows;
}

}  // namespace

void writePage(const std::vector<DrawnFigure>& drawn_figures, unsigned seed, const std::string& file) {
  ReportPage page("Figures and tables of the documents, reproduced");
  const auto agrees = rowsOf(drawn_figures, Verdict::agrees), better = rowsOf(drawn_figures, Verdict::better),
             differs = rowsOf(drawn_figures, Verdict::differs);
  page.html() << STYLE << "<p class=\"verdict\">"
              << formatted("%zu numbers agree, %zu are better here, %zu do not agree; %zu figures, seed %u.",
                           agrees.size(), better.size(), differs.size(), drawn_figures.size(), seed)
              << "</p>\n<p><a href=\"#agrees\">agreement</a>, <a href=\"#better\">better here</a>, <a "
                 "href=\"#differs\">disagreement</a>, <a href=\"#figures\">the figures</a></p>\n";
  const std::tuple<Verdict, const char*, const std::vector<FigureRow>*> parts[] = {
      {Verdict::agrees, "Agreement", &agrees},
      {Verdict::better, "Better here", &better},
      {Verdict::differs, "Disagreement", &differs}};
  for (const auto& [verdict, title, rows] : parts) {
    page.html() << "<h2 id=\"" << nameOf(verdict) << "\">" << title << "</h2>\n";
    if (rows->empty()) page.html() << "<p>Nothing.</p>\n";
    table(page, *rows, true);
  }
  page.html() << "<span id=\"figures\"></span>\n";
  for (const DrawnFigure& one : drawn_figures) {
    page.html() << "<h2 id=\"" << one.figure.name << "\">" << escapedHtml(one.figure.title)
                << "</h2>\n<p><code>rosrun "
                << "smartmill_studies gallery --only " << one.figure.name << " --seed " << seed
                << " -o DIR</code></p>\n";
    for (const std::string& picture : one.drawn.pictures) page.picture(picture, one.figure.title);
    std::vector<FigureRow> rows;
    for (const Compared& row : one.drawn.rows) rows.emplace_back(&one.figure, &row);
    table(page, rows, false);
  }
  page.write(file);
}

}  // namespace smartmill::studies
