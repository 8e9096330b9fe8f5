#include "smartmill_core/program.h"

#include <gtest/gtest.h>
#include <CLI/CLI.hpp>

#include "smartmill_core/error.h"

namespace smartmill {
namespace {

/// Exit code of a program with one needed number.
template <typename Run>
int exitOf(std::vector<const char*> words, const Run& run) {
  CLI::App app{"A program."};
  double number = 0.0;
  app.add_option("number", number, "any")->required();
  return runProgram(app, static_cast<int>(words.size()), words.data(), [&] { return run(number); });
}

TEST(Program, EndsWithTheCodeOfWhatItRan) {
  EXPECT_EQ(exitOf({"/bin/halve", "3"}, [](double n) { return static_cast<int>(n); }), 3);
  EXPECT_EQ(exitOf({"/bin/halve", "3"}, [](double) {}), 0);
}

TEST(Program, SaysAnErrorInOneLine) {
  testing::internal::CaptureStderr();
  EXPECT_EQ(exitOf({"/bin/halve", "3"}, [](double) { throw Error("model.yaml: teeth: 0"); }), 1);
  EXPECT_EQ(testing::internal::GetCapturedStderr(), "halve: model.yaml: teeth: 0\n");
}

TEST(Program, RefusesAWrongCommandLine) {
  testing::internal::CaptureStderr();
  testing::internal::CaptureStdout();
  EXPECT_EQ(exitOf({"halve"}, [](double) {}), 2);
  EXPECT_EQ(exitOf({"halve", "many"}, [](double) {}), 2);
  EXPECT_EQ(exitOf({"halve", "--help"}, [](double) {}), 0);
  EXPECT_NE(testing::internal::GetCapturedStdout().find("A program."), std::string::npos);
  EXPECT_NE(testing::internal::GetCapturedStderr(), "");
}

}  // namespace
}  // namespace smartmill
