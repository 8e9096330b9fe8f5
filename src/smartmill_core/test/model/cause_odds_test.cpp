#include "smartmill_core/model/cause_odds.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "smartmill_core/error.h"
#include "smartmill_core/testing/temporary_folder.h"

namespace smartmill {
namespace {

using ::testing::HasSubstr;

TEST(CauseOdds, readsBackWhatWasWritten) {
  const TemporaryFolder folder;
  CauseOdds odds;
  odds.machines = 8;
  odds.other = 0.5 / 8.5;
  odds.listed = {{"runout", 2.6}, {"unbalance", 1e-12}};
  writeCauseOdds(odds, folder.file("prior.yaml"));
  const CauseOdds read = readCauseOdds(folder.file("prior.yaml"));
  EXPECT_EQ(read.machines, 8u);
  EXPECT_EQ(read.other, odds.other);
  EXPECT_EQ(read.listed, odds.listed);
  EXPECT_EQ(read.of("unbalance"), 1e-12);
  EXPECT_EQ(read.of("tool_wear"), odds.other);
  odds.listed.clear();
  writeCauseOdds(odds, folder.file("none.yaml"));
  EXPECT_TRUE(readCauseOdds(folder.file("none.yaml")).listed.empty());
  EXPECT_THROW(writeCauseOdds(odds, folder.file("") + "no/where.yaml"), Error);
}

struct Bad {
  const char *from, *to, *message;
};

TEST(CauseOdds, errorsNameTheKeyInOneLine) {
  const std::string good =
      "format: smartmill-causes/1\nmachines: 8\nother_odds: 0.06\nodds:\n  runout: 0.4\n";
  const TemporaryFolder folder;
  EXPECT_NO_THROW(readCauseOdds(folder.write("good.yaml", good)));
  for (const Bad& bad :
       {Bad{"runout", "runuot", "odds.runuot: is not an effect of the catalogue"},
        Bad{"0.4", ".inf", "odds.runout"}, Bad{"0.4", ".nan", "odds.runout"},
        Bad{"0.4", "1e999", "odds.runout"}, Bad{"0.4", "0", "odds.runout"}, Bad{"0.4", "-1.0", "odds.runout"},
        Bad{"0.4", "often", "odds.runout"}, Bad{"other_odds: 0.06", "other_odds: 0", "other_odds"},
        Bad{"other_odds: 0.06\n", "", "other_odds"}, Bad{"machines: 8", "machines: -1", "machines"},
        Bad{"machines: 8", "machines: 8\nshop: north", "shop"},
        Bad{"causes/1", "causes/2", "smartmill-causes/2"},
        Bad{"  runout: 0.4", "  runout: 0.4\n  runout: 0.5", "runout"}}) {
    std::string text = good;
    text.replace(text.find(bad.from), std::string(bad.from).size(), bad.to);
    const std::string file = folder.write("bad.yaml", text);
    try {
      readCauseOdds(file);
      ADD_FAILURE() << text;
    } catch (const Error& error) {
      const std::string line = error.what();
      EXPECT_THAT(line, HasSubstr(bad.message)) << text;
      EXPECT_EQ(line.rfind(file, 0), 0u) << line;
      EXPECT_EQ(line.find('\n'), std::string::npos) << line;
    }
  }
}

}  // namespace
}  // namespace smartmill
