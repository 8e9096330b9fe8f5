#pragma once

#include <sstream>
#include <string>

namespace smartmill {

/// Text escaped for HTML.
std::string escapedHtml(const std::string& text);

/// A report as one self-contained HTML file. All reports of the project share its style (the panel's colours,
/// dark or light), tables that sort by a click on a column head, and pictures that open large, zoom with
/// wheel or fingers and pan when dragged.
class ReportPage {
 public:
  explicit ReportPage(const std::string& title);

  /// Direct HTML output, for content without a method below.
  std::ostream& html() { return body_; }
  /// Embeds a picture. @throws Error when it cannot be read
  void picture(const std::string& file, const std::string& caption);
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
