#include "gallery/gallery.h"

#include <filesystem>
#include <set>

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
  EXPECT_EQ(compareNumber("a", 10.0, 10.4, 0.0, 0.05, "").verdict, Verdict::agrees);
  EXPECT_EQ(compareNumber("a", 10.0, 10.6, 0.0, 0.05, "").verdict, Verdict::differs);
  EXPECT_EQ(compareNumber("a", -10.0, -10.4, 0.0, 0.05, "").verdict, Verdict::agrees);
  EXPECT_EQ(compareNumber("a", -10.0, 10.0, 0.0, 0.05, "").verdict, Verdict::differs);
}

// Constants of the thesis's load meter (eq. 3.11, section 3.2.1), recovered with a resolution of 3e-4 V.
TEST(Gallery, theLoadMetersNumbersComeBack) {
  const TemporaryFolder folder;
  for (const Figure& figure : loadMeterFigures()) {
    if (figure.name == "dunwoody_3_5_machines") continue;  // half a minute
    const Drawn drawn = figure.draw(folder.file(""), 3);
    for (const std::string& picture : drawn.pictures) EXPECT_GT(std::filesystem::file_size(picture), 5000u);
    for (const Compared& row : drawn.rows)
      EXPECT_NE(row.verdict, Verdict::differs) << row.what << ": " << row.ours;
  }
}

Drawn drawn(const std::string& name, const std::string& folder, unsigned seed) {
  for (const Figure& figure : allFigures())
    if (figure.name == name) return figure.draw(folder, seed);
  ADD_FAILURE() << "no figure has the name " << name;
  return {};
}

// References: weights, the table dynamometer and the square of the speed (Burzoni eq. 3-6).
TEST(Gallery, theSpindleSensorTellsWeightsAndUnbalance) {
  const TemporaryFolder folder;
  for (const char* name : {"burzoni_13", "burzoni_16"}) {
    const Drawn found = drawn(name, folder.file(""), 2);
    ASSERT_EQ(found.pictures.size(), 1u) << name;
    EXPECT_GT(std::filesystem::file_size(found.pictures[0]), 20000u);
    ASSERT_GE(found.rows.size(), 2u);
    for (std::size_t i = 0; i < 2; ++i)
      EXPECT_EQ(found.rows[i].verdict, Verdict::agrees) << found.rows[i].what << ": " << found.rows[i].ours;
  }
}

// The true force is an input of the simulation.
TEST(Gallery, theCurrentTellsTheForce) {
  const TemporaryFolder folder;
  for (const Compared& row : drawn("cheng_5", folder.file(""), 2).rows)
    EXPECT_EQ(row.verdict, Verdict::agrees) << row.what << ": " << row.ours;
}

// A tool hit above its tip appears stiffer; the factor of each mode follows from its beam shape.
TEST(Gallery, theHammersOffsetStiffens) {
  const TemporaryFolder folder;
  const Drawn found = drawn("dunwoody_4_5", folder.file(""), 2);
  ASSERT_EQ(found.rows.size(), 6u);
  EXPECT_EQ(found.rows[1].verdict, Verdict::agrees) << found.rows[1].ours;
  EXPECT_EQ(found.rows[3].verdict, Verdict::better) << found.rows[3].ours;
}

TEST(Gallery, thePageOpensWithTheCounts) {
  const TemporaryFolder folder;
  const Figure figure{"one", "A <figure>", nullptr};
  const Drawn drawn{{}, {{"a", "1", "1", Verdict::agrees, ""}, {"b", "1", "2", Verdict::differs, "<why>"}}};
  const std::string file = folder.file("page.html");
  writePage({{figure, drawn}}, 7, file);
  const std::string text = readText(file);
  EXPECT_THAT(text, HasSubstr("1 numbers agree, 0 are better here, 1 do not agree; 1 figures, seed 7."));
  EXPECT_THAT(text, HasSubstr("&lt;why&gt;"));
  EXPECT_THAT(text, HasSubstr("A &lt;figure&gt;"));
  EXPECT_LT(text.find("Agreement"), text.find("Disagreement"));
}

}  // namespace
}  // namespace smartmill::studies
