#pragma once

#include <sstream>
#include <string>

namespace smartmill {

/// Text as it stands in HTML.
std::string escapedHtml(const std::string& text);

/// A report as one HTML file that needs no server and no other file: every report of the project has this
/// look (the panel's colours, dark or light), tables that sort by the head that is touched, and pictures that
/// open large, zoom with wheel or fingers and move when dragged.
class ReportPage {
 public:
  explicit ReportPage(const std::string& title);

  /// For what the calls below do not know: HTML.
  std::ostream& html() { return body_; }
  /// A picture, embedded. @throws Error when it cannot be read
  void picture(const std::string& file, const std::string& caption);
  /// Of Markdown what the project's reports use: headings, paragraphs, tables, lists, pictures (from a
  /// folder), **bold** and `code`. A title of the first level is the page's own.
  void markdown(const std::string& text, const std::string& folder);

  std::string text() const;
  /// @throws Error
  void write(const std::string& file) const;

 private:
  std::string title_;
  std::ostringstream body_;
};

}  // namespace smartmill
