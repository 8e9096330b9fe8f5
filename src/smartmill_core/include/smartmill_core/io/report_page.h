#pragma once

#include <sstream>
#include <string>
#include <vector>

namespace smartmill {

/// Text escaped for HTML.
std::string escapedHtml(const std::string& text);

/// Curves over one axis that the page draws: the wheel zooms, dragging moves, a double click shows
/// everything, the pointer reads values. Printed as shown.
struct PagePlot {
  struct Curve {
    std::string name;
    std::string colour;    ///< as in CSS
    bool is_dots = false;  ///< not joined by a line
    std::vector<double> x, y;
  };
  struct Mark {
    double x = 0.0;
    std::string text;
  };
  std::string title, x_label, y_label;  ///< labels with their unit
  bool log_y = false;                   ///< values of 0 and below are not drawn
  std::vector<Curve> curves;            ///< later ones on top
  std::vector<Mark> marks = {};         ///< dashed vertical lines
};

/// A report as one self-contained HTML file. All reports of the project share its style (the panel's colours,
/// dark or light), tables that sort by a click on a column head and scroll in their own box (of class
/// "stack": whose cells are below each other on a phone), <details> that open when printed, and pictures that
/// open large, zoom with wheel or fingers and pan when dragged.
class ReportPage {
 public:
  explicit ReportPage(const std::string& title);

  /// Direct HTML output, for content without a method below.
  std::ostream& html() { return body_; }
  /// Embeds a picture. @throws Error when it cannot be read
  void picture(const std::string& file, const std::string& caption);
  void plot(const PagePlot& plot);
  /// Begins and ends a part of the page of which the reader chooses one at a time.
  void beginChoice(const std::string& label) {
    body_ << "<section data-choice=\"" << escapedHtml(label) << "\">\n";
  }
  void endChoice() { body_ << "</section>\n"; }
  /// By hand, since libcmark has no tables and pictures in the file need a walk through its tree. The subset
  /// of Markdown that the project's reports use: headings, paragraphs, tables, lists, pictures (from a
  /// folder), **bold** and `code`. A first-level title replaces the title of the page.
  void markdown(const std::string& text, const std::string& folder);

  std::string text() const;
  /// @throws Error
  void write(const std::string& file) const;

 private:
  std::string title_;
  std::ostringstream body_;
};

}  // namespace smartmill
