#include "smartmill_exchange/mtconnect/shdr.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "smartmill_exchange/items/catalogue.h"

namespace smartmill::exchange {
namespace {

using ::testing::HasSubstr;

constexpr double NOW = 951782400.25;  // 2000-02-29T00:00:00.25Z
const std::string TIME = "2000-02-29T00:00:00.250000Z|";

TEST(Shdr, LinesOfEachCategory) {
  ShdrWriter writer("uuid");
  EXPECT_EQ(writer.observe({indexOf("feed"), NOW, 12.5}), TIME + "feed|12.5\n");
  EXPECT_EQ(writer.observe({indexOf("program"), NOW, Text{"a|b\nc"}}), TIME + "program|a b c\n");
  EXPECT_EQ(writer.observe({indexOf("feed"), NOW, Unavailable{}}), TIME + "feed|UNAVAILABLE\n");
  EXPECT_EQ(writer.observe({indexOf("force_peak_tooth"), NOW, DataSet{{"t1", 1.5}, {"t2", 2.0}}}),
            TIME + "force_peak_tooth|t1=1.5 t2=2\n");
  EXPECT_EQ(writer.observe({indexOf("alarms"), NOW, Activations{{true, "417", "SERVO"}}}),
            TIME + "alarms|fault|417|||SERVO\n");
  EXPECT_EQ(writer.observe({indexOf("alarms"), NOW, Activations{{false, "1", "w"}}}),
            TIME + "alarms|normal|417|||\n" + TIME + "alarms|warning|1|||w\n");
  EXPECT_EQ(writer.observe({indexOf("alarms"), NOW, Activations{}}), TIME + "alarms|normal||||\n");
}

TEST(Shdr, AnAssetIsAMultilineDocument) {
  ShdrWriter writer("uuid");
  const std::string lines = writer.store({"modes.a", "ToolModes", NOW});
  EXPECT_EQ(lines.find(TIME + "@ASSET@|modes.a|ToolModes|--multiline--modes.a\n<s:ToolModes "), 0u);
  EXPECT_THAT(lines, ::testing::EndsWith("</s:ToolModes>\n--multiline--modes.a\n"));
  EXPECT_THAT(lines, HasSubstr("deviceUuid=\"uuid\""));
}

TEST(Shdr, AClientThatConnectsGetsEveryValueAndAsset) {
  ShdrWriter writer("uuid");
  writer.observe({indexOf("feed"), NOW, 1.0});
  writer.observe({indexOf("feed"), NOW, 2.0});
  writer.observe({indexOf("alarms"), NOW, Activations{{true, "1", "a"}, {true, "2", "b"}}});
  writer.store({"modes.a", "ToolModes", NOW});
  const std::string greeting = writer.greeting(NOW);
  EXPECT_THAT(greeting, HasSubstr(TIME + "feed|2\n"));
  EXPECT_THAT(greeting, HasSubstr(TIME + "alarms|fault|1|||a\n" + TIME + "alarms|fault|2|||b\n"));
  EXPECT_THAT(greeting, HasSubstr(TIME + "line|UNAVAILABLE\n"));
  EXPECT_THAT(greeting, HasSubstr("@ASSET@|modes.a"));
}

TEST(Shdr, OnlyCompletePingsCount) {
  ShdrCommands commands;
  const auto push = [&](const std::string& bytes) { return commands.push(bytes.data(), bytes.size()); };
  EXPECT_EQ(push("* PI"), 0);
  EXPECT_EQ(push("NG\r\n* PING\n* PING"), 2);
  EXPECT_EQ(push("x\n"), 0);
  EXPECT_EQ(push(std::string(5000, 'a')), 0);
  EXPECT_EQ(push("\n* PING \n"), 1);
}

}  // namespace
}  // namespace smartmill::exchange
