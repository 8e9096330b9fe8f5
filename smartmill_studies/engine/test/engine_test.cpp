// The runner (run, case, collect): only complete result files count as done.
#include <unistd.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "smartmill_core/testing/temporary_folder.h"

namespace smartmill {
namespace {

using ::testing::HasSubstr;

class StudiesEngine : public ::testing::Test {
 protected:
  void SetUp() override {
    if (std::system("command -v parallel > /dev/null") != 0)
      GTEST_SKIP() << "./setup --with-fleet installs GNU parallel";
  }
  /// @return exit code of a command of the runner, whose output is output()
  int call(const std::string& command) {
    return WEXITSTATUS(
        std::system((STUDIES "/" + command + " > " + folder_.file("output") + " 2>&1").c_str()));
  }
  static std::string contentOf(const std::string& file) {
    std::ostringstream text;
    text << std::ifstream(file).rdbuf();
    return text.str();
  }
  std::string output() const { return contentOf(folder_.file("output")); }
  std::string at(const std::string& name) const { return folder_.file(name); }

  TemporaryFolder folder_;
};

TEST_F(StudiesEngine, goesOnWhereItEndedAndGivesTheSameTable) {
  ASSERT_EQ(call("run self_test -j 2 --nice 0 -o " + at("a")), 0) << output();
  std::filesystem::remove(at("a/cases/2.json"));
  // A partly written result does not count.
  std::ofstream(at("a/cases/2.json.part.host.1")) << "{\"case\": 2, ";
  EXPECT_EQ(call("collect " + at("a")), 1);
  EXPECT_THAT(output(), HasSubstr("3 of 4 cases are done"));
  ASSERT_EQ(call("run self_test -j 1 --nice 0 -o " + at("a")), 0) << output();
  ASSERT_EQ(call("collect " + at("a")), 0) << output();
  EXPECT_THAT(output(), HasSubstr("4 of 4 cases"));

  ASSERT_EQ(call("run self_test -j 1 --nice 0 -o " + at("b")), 0) << output();
  ASSERT_EQ(call("collect " + at("b")), 0) << output();
  EXPECT_FALSE(contentOf(at("a/table.md")).empty());
  EXPECT_EQ(contentOf(at("a/table.md")), contentOf(at("b/table.md")));
  EXPECT_EQ(contentOf(at("a/lines.jsonl")), contentOf(at("b/lines.jsonl")));

  EXPECT_EQ(call("run self_test -j 1 --seed 5 -o " + at("a")), 1);
  EXPECT_THAT(output(), HasSubstr("contains a run with another seed"));
  // A case of another build is refused.
  std::string manifest = contentOf(at("a/study.json"));
  manifest.replace(manifest.find("\"build\": \"") + 10, 4, "none");
  std::ofstream(at("a/study.json")) << manifest;
  std::filesystem::remove(at("a/cases/1.json"));
  EXPECT_EQ(call("case " + at("a") + " 1"), 1);
  EXPECT_THAT(output(), HasSubstr("is not the build of this study"));
}

TEST_F(StudiesEngine, goesOnFromWhatAnotherMachineHasDone) {
  ASSERT_EQ(call("run self_test -j 2 --nice 0 -o " + at("there")), 0) << output();
  std::string lines;
  for (const char* number : {"0", "2"}) lines += contentOf(at("there/cases/") + number + ".json");
  std::ofstream(at("done.jsonl")) << lines;
  ASSERT_EQ(call("run self_test -j 1 --nice 0 --from " + at("done.jsonl") + " -o " + at("here")), 0)
      << output();
  for (const char* number : {"0", "2"}) {
    const std::string name = std::string("/cases/") + number + ".json";
    EXPECT_EQ(contentOf(at("here" + name)), contentOf(at("there" + name)));
  }
  ASSERT_EQ(call("collect " + at("there")), 0) << output();
  ASSERT_EQ(call("collect " + at("here")), 0) << output();
  EXPECT_EQ(contentOf(at("here/table.md")), contentOf(at("there/table.md")));

  lines.replace(lines.rfind("\"build\": \"") + 10, 4, "none");
  std::ofstream(at("other.jsonl")) << lines;
  EXPECT_EQ(call("run self_test -j 1 --from " + at("other.jsonl") + " -o " + at("c")), 1);
  EXPECT_THAT(output(), HasSubstr("other.jsonl: line 2 is of another build"));
  EXPECT_EQ(call("run self_test -j 1 --seed 5 --from " + at("done.jsonl") + " -o " + at("e")), 1);
  EXPECT_THAT(output(), HasSubstr("done.jsonl: line 1 is of another seed (1, not 5)"));
  std::ofstream(at("torn.jsonl")) << lines.substr(0, 40) << "\n";
  EXPECT_EQ(call("run self_test -j 1 --from " + at("torn.jsonl") + " -o " + at("d")), 1);
  EXPECT_THAT(output(), HasSubstr("torn.jsonl: line 1 is not a case of a study"));
  EXPECT_EQ(call("run self_test -j 1 --from " + at("none.jsonl") + " -o " + at("d")), 1);
  EXPECT_THAT(output(), HasSubstr("none.jsonl: cannot be read"));
}

TEST_F(StudiesEngine, refusesWhatItDoesNotKnow) {
  EXPECT_EQ(call("run nothing -o " + at("a")), 2);
  EXPECT_THAT(output(), HasSubstr("'nothing' is not a study; expected one of bench"));
  EXPECT_EQ(call("collect " + at("nowhere")), 1);
  EXPECT_THAT(output(), HasSubstr("study.json: not a study"));
  std::ofstream(at("hosts")) << "two hosts\n";
  EXPECT_EQ(call("run self_test --hosts " + at("hosts") + " -o " + at("c")), 1);
  EXPECT_THAT(output(), HasSubstr("expected SLOTS/HOST"));
}

}  // namespace
}  // namespace smartmill
