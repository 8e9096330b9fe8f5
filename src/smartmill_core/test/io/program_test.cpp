#include "smartmill_core/program.h"

#include <gtest/gtest.h>

#include "smartmill_core/error.h"

namespace smartmill {
namespace {

/// Exit code of a program with one required number.
template <typename Run>
int exitOf(const std::vector<const char*>& words, const Run& run) {
  CommandLine line("A program.");
  double number = 0.0;
  line.option("number", number, "any").required();
  return runProgram(line, static_cast<int>(words.size()), words.data(), [&] { return run(number); });
}

TEST(Program, EndsWithTheCodeOfItsBody) {
  EXPECT_EQ(exitOf({"/bin/halve", "3"}, [](double n) { return static_cast<int>(n); }), 3);
  EXPECT_EQ(exitOf({"/bin/halve", "3"}, [](double) {}), 0);
}

TEST(Program, ReportsAnErrorInOneLine) {
  testing::internal::CaptureStderr();
  EXPECT_EQ(exitOf({"/bin/halve", "3"}, [](double) { throw Error("model.yaml: teeth: 0"); }), 1);
  EXPECT_EQ(testing::internal::GetCapturedStderr(), "halve: model.yaml: teeth: 0\n");
}

TEST(Program, RejectsAWrongCommandLine) {
  testing::internal::CaptureStderr();
  testing::internal::CaptureStdout();
  EXPECT_EQ(exitOf({"halve"}, [](double) {}), 2);
  EXPECT_EQ(exitOf({"halve", "many"}, [](double) {}), 2);
  EXPECT_EQ(exitOf({"halve", "--help"}, [](double) {}), 0);
  EXPECT_NE(testing::internal::GetCapturedStdout().find("A program."), std::string::npos);
  EXPECT_NE(testing::internal::GetCapturedStderr(), "");
}

TEST(Program, ReadsItsOptions) {
  CommandLine line("Cuts.");
  std::string kind = "slot";
  std::vector<double> speeds;
  double share = 0.5;
  int cuts = 3;
  bool pictures = true;
  const CommandOptions make = line.command("make", "makes"), show = line.command("show", "shows");
  make.option("--kind", kind, "of cut").oneOf({"slot", "side"}).showDefault();
  make.option("--speeds", speeds, "[rpm]").count(1, 4).commas();
  make.option("--share", share, "of all").within(0.0, 1.0);
  make.option("--cuts", cuts, "how many").positive();
  make.flag("!--no-pictures", pictures, "tables only");
  const auto parse = [&](std::vector<const char*> words) {
    words.insert(words.begin(), "cuts");
    return line.parse(static_cast<int>(words.size()), words.data());
  };
  EXPECT_FALSE(
      parse({"make", "--kind", "side", "--speeds", "1000,2000", "--cuts", "5", "--no-pictures"}).stop);
  EXPECT_TRUE(make.parsed());
  EXPECT_FALSE(show.parsed());
  EXPECT_EQ(kind, "side");
  EXPECT_EQ(speeds, (std::vector<double>{1000.0, 2000.0}));
  EXPECT_EQ(cuts, 5);
  EXPECT_FALSE(pictures);
  testing::internal::CaptureStderr();
  for (const auto& words : std::vector<std::vector<const char*>>{{},
                                                                 {"make", "--kind", "round"},
                                                                 {"make", "--share", "1.5"},
                                                                 {"make", "--cuts", "0"},
                                                                 {"make", "--new"}}) {
    EXPECT_EQ(parse(words).code, 2);
  }
  testing::internal::GetCapturedStderr();
  EXPECT_NE(line.help().find("make"), std::string::npos);
}

TEST(Program, MayRejectItsCommandLineLater) {
  testing::internal::CaptureStderr();
  EXPECT_EQ(exitOf({"/bin/halve", "3"}, [](double) { throw UsageError("expected a campaign"); }), 2);
  EXPECT_EQ(testing::internal::GetCapturedStderr(), "halve: expected a campaign\n");
}

}  // namespace
}  // namespace smartmill
