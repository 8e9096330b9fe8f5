#include "gallery/page.h"

#include <algorithm>
#include <sstream>
#include <utility>

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

const char* styleOf(Verdict verdict) {
  if (verdict == Verdict::shown) return "";
  return verdict == Verdict::differs ? "bad" : "good";
}

/// A row and its figure.
using FigureRow = std::pair<const Figure*, const Compared*>;

/// @param linked whether each row has a link to its figure
void table(ReportPage& page, const std::vector<FigureRow>& rows, bool linked) {
  if (rows.empty()) return;
  page.html() << "<table><tr>" << (linked ? "<th>figure</th>" : "")
              << "<th>number</th><th>document</th><th>here</th><th>kind</th><th></th><th>why</th></tr>\n";
  for (const auto& [figure, row] : rows) {
    page.html() << "<tr>";
    if (linked) page.html() << "<td><a href=\"#" << figure->name << "\">" << figure->name << "</a></td>";
    page.html() << cell(row->what) << cell(row->seed, "document") << cell(row->ours, "here")
                << cell(nameOf(row->kind), "kind") << "<td class=\"" << styleOf(row->verdict) << "\">"
                << nameOf(row->verdict) << "</td>" << (row->why.empty() ? "<td></td>" : cell(row->why, "why"))
                << "</tr>\n";
  }
  page.html() << "</table>\n";
}

/// Of one kind, by verdict.
std::vector<FigureRow> rowsOf(const std::vector<DrawnFigure>& drawn_figures, Kind kind) {
  std::vector<FigureRow> rows;
  for (const Verdict verdict : {Verdict::agrees, Verdict::better, Verdict::differs, Verdict::shown})
    for (const DrawnFigure& one : drawn_figures)
      for (const Compared& row : one.drawn.rows)
        if (row.kind == kind && row.verdict == verdict) rows.emplace_back(&one.figure, &row);
  return rows;
}

const char* meaningOf(Kind kind) {
  switch (kind) {
    case Kind::reproduced:
      return "The reference shares neither code nor input with what is tested.";
    case Kind::restated:
      return "A constant, an identity, or an input that is put in and found again: no evidence of more than "
             "right arithmetic.";
    default:
      return "Figures of another rig, next to ours: neither agreement nor better.";
  }
}

std::string anchorOf(Kind kind) {
  std::string anchor = nameOf(kind);
  std::replace(anchor.begin(), anchor.end(), ' ', '_');
  return anchor;
}

}  // namespace

void writePage(const std::vector<DrawnFigure>& drawn_figures, unsigned seed, const std::string& file) {
  ReportPage page("Figures and tables of the documents, reproduced");
  std::vector<Compared> all;
  for (const DrawnFigure& one : drawn_figures)
    all.insert(all.end(), one.drawn.rows.begin(), one.drawn.rows.end());
  page.html() << STYLE << "<p class=\"verdict\">";
  for (const Kind kind : KINDS)
    page.html() << "<a href=\"#" << anchorOf(kind) << "\">" << summaryOf(all, kind) << "</a><br>";
  page.html() << formatted("%zu figures, seed %u.", drawn_figures.size(), seed)
              << "</p>\n<p><a href=\"#figures\">the figures</a></p>\n";
  for (const Kind kind : KINDS) {
    page.html() << "<h2 id=\"" << anchorOf(kind) << "\">" << nameOf(kind) << "</h2>\n<p>" << meaningOf(kind)
                << "</p>\n";
    const std::vector<FigureRow> rows = rowsOf(drawn_figures, kind);
    if (rows.empty()) page.html() << "<p>Nothing.</p>\n";
    table(page, rows, true);
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
