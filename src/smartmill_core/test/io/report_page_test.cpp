#include "smartmill_core/io/report_page.h"

#include <cmath>

#include <gtest/gtest.h>

#include "smartmill_core/error.h"
#include "smartmill_core/io/text_file.h"
#include "smartmill_core/testing/temporary_folder.h"

namespace smartmill {
namespace {

TEST(ReportPage, MarkdownBecomesHtml) {
  const TemporaryFolder folder;
  folder.write("p.png", "Man");
  ReportPage page("nameless");
  page.markdown(
      "# A session\n\n## Forces & moments\n\n| axis | **N** |\n|---|---:|\n| x | 1 < 2 |\n| y | `3` |\n"
      "- one\n- two\n\nTwo lines\nof text.\n\n![how it went](p.png)\n",
      folder.file("."));
  const std::string text = page.text();
  for (const char* part :
       {"<title>A session</title>", "<h2>Forces &amp; moments</h2>", "<tr><th>axis<th><b>N</b></tr>",
        "<tr><td>x<td>1 &lt; 2</tr>", "<td><code>3</code></tr>", "<ul><li>one</li>\n<li>two</li>",
        "<p>Two lines\nof text.\n</p>", "src=\"data:image/png;base64,TWFu\"", "<figcaption>how it went"})
    EXPECT_NE(text.find(part), std::string::npos) << part << " is missing in\n" << page.text();
  EXPECT_EQ(text.find("<td>---"), std::string::npos);  // the line below a table's header
}

// Text of a campaign's name is not markup.
TEST(ReportPage, EscapesNames) {
  EXPECT_EQ(escapedHtml("<a href=\"x\">&"), "&lt;a href=&quot;x&quot;&gt;&amp;");
  ReportPage page("<script>alert(1)</script>");
  page.markdown("<b>no</b>\n", ".");
  EXPECT_EQ(page.text().find("<script>alert"), std::string::npos);
  EXPECT_EQ(page.text().find("<b>no"), std::string::npos);
}

TEST(ReportPage, PlotsKeepTheirDataAndEscapeIt) {
  ReportPage page("t");
  PagePlot plot;
  plot.title = "fx < fy";
  plot.x_label = "angle [deg]";
  plot.curves = {{"</script>", "#000", false, {0.0, 1.0, 2.0}, {1234.5678, NAN, -2e-7}}};
  plot.marks = {{1.5, "2x"}};
  page.plot(plot);
  const std::string text = page.text();
  EXPECT_NE(text.find("<h3>fx &lt; fy</h3>"), std::string::npos);
  EXPECT_NE(text.find("[1234.568,null,-2e-07]"), std::string::npos) << text;
  EXPECT_NE(text.find("\"marks\":[{\"x\":1.5,\"text\":\"2x\"}]"), std::string::npos) << text;
  EXPECT_NE(text.find("\"name\":\"<\\/script>\""), std::string::npos);
}

// The page opens without server and network: it has no external references.
TEST(ReportPage, HasNoExternalReferences) {
  const std::string text = ReportPage("t").text();
  for (const char* from : {"http:", "https:", "src=\"/", "@import", "url("})
    EXPECT_EQ(text.find(from), std::string::npos) << from;
}

TEST(ReportPage, RejectsMissingFiles) {
  ReportPage page("t");
  EXPECT_THROW(page.picture("/nowhere/p.png", "p"), Error);
  EXPECT_THROW(page.write("/nowhere/r.html"), Error);
}

}  // namespace
}  // namespace smartmill
