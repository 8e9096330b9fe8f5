#include "gallery/page.h"

#include <sstream>

#include "smartmill_core/formatted.h"
#include "smartmill_core/io/report_page.h"

namespace smartmill::studies {
namespace {

std::string cell(const std::string& text) {
  return "<td>" + escapedHtml(text) + "</td>";
}

/// A row, and the figure whose it is.
using Told = std::pair<const Figure*, const Compared*>;

void table(ReportPage& page, const std::vector<Told>& rows) {
  if (rows.empty()) return;
  page.html() << "<table><tr><th>figure</th><th>number</th><th>document</th><th>here</th><th></th><th>why</"
                 "th></tr>\n";
  for (const auto& [figure, row] : rows) {
    const char* look = row->verdict == Verdict::differs ? "bad" : "good";
    page.html() << "<tr><td><a href=\"#" << figure->name << "\">" << figure->name << "</a></td>"
                << cell(row->what) << cell(row->seed) << cell(row->ours) << "<td class=\"" << look << "\">"
                << nameOf(row->verdict) << "</td>" << cell(row->why) << "</tr>\n";
  }
  page.html() << "</table>\n";
}

std::vector<Told> rowsOf(const std::vector<Shown>& shown, Verdict verdict) {
  std::vector<Told> rows;
  for (const Shown& one : shown)
    for (const Compared& row : one.drawn.rows)
      if (row.verdict == verdict) rows.emplace_back(&one.figure, &row);
  return rows;
}

}  // namespace

void writePage(const std::vector<Shown>& shown, unsigned seed, const std::string& file) {
  ReportPage page("The documents' figures and tables, redrawn");
  const auto agrees = rowsOf(shown, Verdict::agrees), better = rowsOf(shown, Verdict::better),
             differs = rowsOf(shown, Verdict::differs);
  page.html() << "<p class=\"verdict\">"
              << formatted("%zu numbers agree, %zu are better here, %zu do not agree; %zu figures, seed %u.",
                           agrees.size(), better.size(), differs.size(), shown.size(), seed)
              << "</p>\n";
  const std::pair<const char*, const std::vector<Told>*> parts[] = {
      {"What agrees", &agrees}, {"What is better", &better}, {"What does not agree", &differs}};
  for (const auto& [title, rows] : parts) {
    page.html() << "<h2>" << title << "</h2>\n";
    if (rows->empty()) page.html() << "<p>Nothing.</p>\n";
    table(page, *rows);
  }
  for (const Shown& one : shown) {
    page.html() << "<h2 id=\"" << one.figure.name << "\">" << escapedHtml(one.figure.title)
                << "</h2>\n<p><code>rosrun "
                << "smartmill_studies gallery --only " << one.figure.name << " --seed " << seed
                << " -o DIR</code></p>\n";
    for (const std::string& picture : one.drawn.pictures) page.picture(picture, one.figure.title);
    std::vector<Told> rows;
    for (const Compared& row : one.drawn.rows) rows.emplace_back(&one.figure, &row);
    table(page, rows);
  }
  page.write(file);
}

}  // namespace smartmill::studies
