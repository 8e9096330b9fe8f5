#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <limits>

#include <gtest/gtest.h>

#include "smartmill_core/error.h"
#include "smartmill_core/io/csv.h"
#include "smartmill_core/io/gnuplot.h"
#include "smartmill_core/io/text_file.h"
#include "smartmill_core/require.h"
#include "smartmill_core/testing/temporary_folder.h"

namespace smartmill {
namespace {

using Cells = std::vector<std::string_view>;

TEST(Require, NamesKeyValueAndTheExpected) {
  require(true, "speed", 3.0, "above 0");
  require("speed", 3.0, Range::positive());
  EXPECT_EQ(errorOf([] { require(false, "lag", -0.5, "less than the record"); }),
            "lag: -0.5, expected less than the record");
  EXPECT_EQ(errorOf([] { require("lag", -0.5, Range::closed(0.0, 10.0), "s"); }),
            "lag: -0.5 is out of range (0 <= value <= 10 s)");
  EXPECT_EQ(errorOf([] { require("noise_rms", 0.0, Range::positive()); }),
            "noise_rms: 0 is out of range (> 0)");
  // NaN and infinity are rejected whatever the condition.
  EXPECT_EQ(errorOf([] { require(true, "a", std::numeric_limits<double>::quiet_NaN(), "a number"); }),
            "a: nan, expected a number");
  EXPECT_NE(errorOf([] { require("a", std::numeric_limits<double>::infinity(), Range{}); }), "");
}

TEST(Csv, ReadsCellsRowByRow) {
  const TemporaryFolder folder;
  folder.write("t.csv",
               "\xEF\xBB\xBF"
               "a, b ,c\r\n1,\"two, \"\"2\"\"\nlines\" ,\r\n\n3,4,");
  CsvReader reader(folder.file("t.csv"));
  Cells cells;
  ASSERT_TRUE(reader.next(&cells));
  EXPECT_EQ(cells, (Cells{"a", "b", "c"}));
  ASSERT_TRUE(reader.next(&cells));
  EXPECT_EQ(cells, (Cells{"1", "two, \"2\"\nlines", ""}));
  EXPECT_EQ(reader.line(), 2);
  ASSERT_TRUE(reader.next(&cells));
  EXPECT_TRUE(isBlank(cells));
  EXPECT_EQ(reader.line(), 4);
  ASSERT_TRUE(reader.next(&cells));
  EXPECT_EQ(cells, (Cells{"3", "4", ""}));
  EXPECT_EQ(reader.line(), 5);
  EXPECT_FALSE(reader.next(&cells));
}

TEST(Csv, RejectsCellsThatAreNotNumbers) {
  const TemporaryFolder folder;
  const std::string file = folder.file("t.csv");
  folder.write("t.csv", "x[N],word\n1.5,a\n+2e3,b\n");
  EXPECT_EQ(readColumns(file, {"x[N]"}), (std::vector<std::vector<double>>{{1.5, 2000.0}}));
  EXPECT_EQ(errorOf([&] { readColumns(file, {"y"}); }), file + ": column y is missing");
  EXPECT_EQ(errorOf([&] { readNumberTable(file); }), file + ": line 2: column word: 'a' is not a number");
  for (const auto& [cell, what] :
       {std::pair("1.5x", "not a number"), std::pair("", "not a number"),
        std::pair("nan", "not a finite number"), std::pair("inf", "not a finite number")}) {
    folder.write("bad.csv", "x\n1\n" + std::string(cell) + ",\n");
    EXPECT_EQ(errorOf([&] { readColumns(folder.file("bad.csv"), {"x"}); }),
              folder.file("bad.csv") + ": line 3: column x: '" + cell + "' is " + what);
  }
  folder.write("empty.csv", "x\n");
  EXPECT_EQ(errorOf([&] { readColumns(folder.file("empty.csv"), {"x"}); }),
            folder.file("empty.csv") + ": no rows");
  folder.write("open.csv", "x\n\"1");
  EXPECT_EQ(errorOf([&] { readNumberTable(folder.file("open.csv")); }),
            folder.file("open.csv") + ": line 2: a quote is not closed");
  EXPECT_EQ(errorOf([&] { readNumberTable(folder.file("none.csv")); }),
            folder.file("none.csv") + ": cannot be read");
}

TEST(Csv, ReadsBackWhatWasWritten) {
  const TemporaryFolder folder;
  CsvWriter csv("rpm,limit[mm],kind", 17);
  csv.row(4500.0, 0.1, "hopf");
  csv.row(std::size_t{7}, std::numeric_limits<double>::infinity(), "say \"a, b\"");
  csv.save(folder.file("t.csv"));
  CsvReader reader(folder.file("t.csv"));
  Cells cells;
  reader.next(&cells);
  reader.next(&cells);
  EXPECT_EQ(reader.number(cells[1], ""), 0.1);
  reader.next(&cells);
  EXPECT_EQ(cells, (Cells{"7", "", "say \"a, b\""}));
  folder.write("n.csv", "rpm,limit[mm]\n1,\n2,3\n");
  const NumberTable table = readNumberTable(folder.file("n.csv"));
  EXPECT_TRUE(std::isnan(table.column("limit")[0]));
  EXPECT_EQ(table.column("limit[mm]")[1], 3.0);
  EXPECT_FALSE(table.has("fx"));
  EXPECT_NE(errorOf([&] { csv.save(folder.file("none/t.csv")); }).find("cannot be written"),
            std::string::npos);
}

TEST(Csv, FindsColumnsWithUnitsAndEmptyCells) {
  const TemporaryFolder folder;
  const NumberTable table =
      readNumberTable(folder.write("table.csv", "time[s],fx[N],limit_mm\n0.5,-1.25e3,\n1,nan,2\n"));
  EXPECT_EQ(table.column("fx")[0], -1250.0);
  EXPECT_TRUE(std::isnan(table.column("fx")[1]));
  EXPECT_TRUE(std::isnan(table.column("limit_mm")[0]));
  EXPECT_THROW(table.column("fy"), Error);
  EXPECT_THROW(readNumberTable(folder.write("short.csv", "time[s],fx[N]\n0.5\n")), Error);
  EXPECT_THROW(readNumberTable(folder.write("word.csv", "time[s]\nabc\n")), Error);
  EXPECT_THROW(readNumberTable(folder.file("absent.csv")), Error);
}

TEST(Gnuplot, DrawsAPicture) {
  const TemporaryFolder folder;
  const std::string png = folder.file("it's.png");
  Gnuplot plot(png, 200, 100);
  plot.block("d", {{0.0, 1.0}, {1.0, std::numeric_limits<double>::quiet_NaN()}, {2.0, 3.0}});
  plot << "plot $d using 1:2 with lines title " << Gnuplot::quoted("a_b's") << "\n";
  plot.draw();
  EXPECT_EQ(readText(png).substr(1, 3), "PNG");
}

TEST(Gnuplot, ReportsAnErrorInOneLine) {
  const TemporaryFolder folder;
  Gnuplot plot(folder.file("a.png"), 200, 100);
  plot << "plott 1\n";
  EXPECT_EQ(errorOf([&] { plot.draw(); }), folder.file("a.png") + ": gnuplot: line 3: invalid command");
}

}  // namespace
}  // namespace smartmill
