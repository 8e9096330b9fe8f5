#include "gallery/gallery.h"

#include <algorithm>
#include <filesystem>
#include <set>
#include <stdexcept>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "gallery/page.h"
#include "smartmill_core/io/text_file.h"
#include "smartmill_core/testing/temporary_folder.h"

namespace smartmill::studies {
namespace {

using ::testing::HasSubstr;

TEST(Gallery, everyFigureHasItsOwnName) {
  std::set<std::string> names;
  for (const Figure& figure : allFigures()) {
    EXPECT_TRUE(names.insert(figure.name).second) << figure.name;
    EXPECT_FALSE(figure.title.empty()) << figure.name;
  }
}

TEST(Gallery, aNumberAgreesWithinItsShareAlone) {
  const auto compareNumber = [](double seed, double ours) {
    return studies::compareNumber(Kind::restated, "a", seed, ours, 0.0, 0.05, "");
  };
  EXPECT_EQ(compareNumber(10.0, 10.4).verdict, Verdict::agrees);
  EXPECT_EQ(compareNumber(10.0, 10.6).verdict, Verdict::differs);
  EXPECT_EQ(compareNumber(-10.0, -10.4).verdict, Verdict::agrees);
  EXPECT_EQ(compareNumber(-10.0, 10.0).verdict, Verdict::differs);
}

TEST(Gallery, onlyAReproducedNumberCanBeBetter) {
  EXPECT_NO_THROW(Compared(Kind::reproduced, "a", "1", "2", Verdict::better, ""));
  EXPECT_THROW(Compared(Kind::restated, "a", "1", "2", Verdict::better, ""), std::logic_error);
  for (const Verdict verdict : {Verdict::agrees, Verdict::better, Verdict::differs})
    EXPECT_THROW(Compared(Kind::another_machine, "a", "1", "2", verdict, ""), std::logic_error);
  EXPECT_NO_THROW(Compared(Kind::another_machine, "a", "1", "2", Verdict::shown, ""));
  EXPECT_THROW(Compared(Kind::reproduced, "a", "1", "2", Verdict::shown, ""), std::logic_error);
}

/// Numbers that do not agree, by the beginning of their text; each states its reason in the figure.
const std::set<std::string>& disagreements() {
  static const std::set<std::string> all{
      // The tables of the document contradict each other.
      "cYx by the line of table 3", "cYz by the line of table 3",
      // 1 % of the other axis, whose resonance at 930 or 1080 Hz is 14 times as large, is not in a model by
      // axis.
      "range of the force over 50 .. 1200 Hz, axis x", "range of the force over 50 .. 1200 Hz, axis y",
      // The taps of the simulated sensor bound no Q at most speeds; his conclusions from them do not arise.
      "best Q of a plant 2, 3 deviations off, x", "best Q of a plant 2, 3 deviations off, y",
      "best Q of the cuts over that of the taps, x", "best Q of the cuts over that of the taps, y",
      "largest RMSE by R of taps and cuts",
      // His update, as printed and corrected: both vibrate before it acts (stability_turning_loop_test).
      "eq. 16 as printed, machine after period 2", "eq. 16 as printed, machine after period 3",
      "eq. 16 as printed, vibration after 6.144 s", "eq. 16 corrected, vibration after 6.144 s"};
  return all;
}

bool isKnown(const std::string& what) {
  const auto& all = disagreements();
  return std::any_of(all.begin(), all.end(),
                     [&](const std::string& known) { return what.compare(0, known.size(), known) == 0; });
}

class EveryFigure : public ::testing::TestWithParam<std::size_t> {};

// A reproduced or restated number leaves its band: fails. So does a known disagreement that has ended.
TEST_P(EveryFigure, isDrawnAndItsNumbersAreInTheirBands) {
  const TemporaryFolder folder;
  const Figure figure = allFigures()[GetParam()];
  const Drawn drawn = (figure.draw_small ? figure.draw_small : figure.draw)(folder.file(""), 1);
  for (const std::string& picture : drawn.pictures)
    EXPECT_GT(std::filesystem::file_size(picture), 5000u) << picture;
  ASSERT_FALSE(drawn.rows.empty());
  for (const Compared& row : drawn.rows)
    EXPECT_EQ(row.verdict == Verdict::differs, isKnown(row.what))
        << nameOf(row.kind) << ", " << row.what << ": document " << row.seed << ", here " << row.ours;
}

INSTANTIATE_TEST_SUITE_P(Gallery, EveryFigure, ::testing::Range<std::size_t>(0, allFigures().size()),
                         [](const auto& at) { return allFigures()[at.param].name; });

TEST(Gallery, thePageOpensWithTheCounts) {
  const TemporaryFolder folder;
  const Figure figure{"one", "A <figure>", nullptr};
  const Drawn drawn{{},
                    {{Kind::reproduced, "a", "1", "1", Verdict::agrees, ""},
                     {Kind::restated, "b", "1", "2", Verdict::differs, "<why>"},
                     {Kind::another_machine, "c", "3", "4", Verdict::shown, ""}}};
  const std::string file = folder.file("page.html");
  writePage({{figure, drawn}}, 7, file);
  const std::string text = readText(file);
  EXPECT_THAT(text, HasSubstr("reproduced: 1 agree, 0 better here, 0 differ"));
  EXPECT_THAT(text, HasSubstr("restated: 0 agree, 1 differ"));
  EXPECT_THAT(text, HasSubstr("another machine: 1, shown next to ours"));
  EXPECT_THAT(text, HasSubstr("1 figures, seed 7."));
  EXPECT_THAT(text, HasSubstr("&lt;why&gt;"));
  EXPECT_THAT(text, HasSubstr("A &lt;figure&gt;"));
  EXPECT_LT(text.find("id=\"reproduced\""), text.find("id=\"restated\""));
  EXPECT_LT(text.find("id=\"restated\""), text.find("id=\"another_machine\""));
}

}  // namespace
}  // namespace smartmill::studies
