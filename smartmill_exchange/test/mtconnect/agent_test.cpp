#include "smartmill_exchange/mtconnect/agent.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "smartmill_core/error.h"
#include "smartmill_exchange/items/catalogue.h"

namespace smartmill::exchange {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

constexpr double NOW = 1.7e9;  // [s]

AgentOptions options(std::size_t buffer = 1000) {
  AgentOptions options;
  options.device = "mill";
  options.uuid = "mill-uuid";
  options.buffer = buffer;
  options.instance = 42;
  return options;
}

class AgentTest : public ::testing::Test {
 protected:
  void observe(const std::string& id, const Value& value) { agent_.observe({indexOf(id), NOW, value}); }
  std::string get(const std::string& target) const { return agent_.answer(target, NOW).document; }
  std::string errorOf(const std::string& target) const {
    const AgentAnswer answer = agent_.answer(target, NOW);
    const std::size_t begin = answer.document.find("errorCode=\"");
    if (answer.status == 200 || begin == std::string::npos) return "none";
    return answer.document.substr(begin + 11, answer.document.find('"', begin + 11) - begin - 11);
  }

  Agent agent_{options(), NOW};
  std::uint64_t begin_ = agent_.buffer().next();
};

TEST_F(AgentTest, BadRequestsAreRefusedWithTheCodesOfTheStandard) {
  for (const char* target :
       {"/sample?from=abc", "/sample?from=1x", "/sample?count=", "/sample?nothing=1", "/sample?from",
        "/current?at=1&interval=100", "/probe?from=1", "/sample?count=-1&interval=10"})
    EXPECT_EQ(errorOf(target), "INVALID_REQUEST") << target;
  for (const char* target :
       {"/sample?from=999999", "/sample?from=0", "/sample?count=0", "/sample?count=1000000",
        "/current?at=99999", "/sample?count=99999999999999999999", "/current?interval=-1",
        "/sample?interval=1&heartbeat=0"})
    EXPECT_EQ(errorOf(target), "OUT_OF_RANGE") << target;
  for (const char* target :
       {"/current?path=//DataItem[", "/current?path=Axes", "/current?path=//DataItem[@type=POSITION]",
        "/current?path=//Nothing", "/current?path=//DataItem[@type='a' or @type='b']"})
    EXPECT_EQ(errorOf(target), "INVALID_XPATH") << target;
  EXPECT_EQ(errorOf("/lathe/current"), "NO_DEVICE");
  EXPECT_EQ(errorOf("/mill/nothing"), "UNSUPPORTED");
  EXPECT_EQ(errorOf("/asset/none"), "ASSET_NOT_FOUND");
  EXPECT_EQ(errorOf("probe"), "INVALID_URI");
  EXPECT_EQ(errorOf("/%zz"), "INVALID_URI");
  EXPECT_EQ(errorOf("/" + std::string(5000, 'a')), "INVALID_URI");
  EXPECT_EQ(agent_.answer("/lathe/current", NOW).status, 404);
  EXPECT_EQ(agent_.answer("/sample?from=abc", NOW).status, 400);
  EXPECT_THAT(get("/sample?from=<&>"), HasSubstr("from=&lt;: expected an integer"));
}

TEST_F(AgentTest, EveryItemIsUnavailableAtTheStart) {
  const std::string document = get("/current");
  for (const DataItem& item : catalogue()) EXPECT_THAT(document, HasSubstr("dataItemId=\"" + item.id + "\""));
  EXPECT_EQ(agent_.buffer().last(), catalogue().size());
}

TEST_F(AgentTest, SamplesAreGivenOnceAndInOrder) {
  for (int i = 1; i <= 10; ++i) observe("feed", 1.5 * i);
  observe("execution", Text{"ACTIVE"});
  std::uint64_t from = begin_;
  std::string all;
  for (int i = 0; i < 4; ++i) {
    const std::string document = get("/mill/sample?from=" + std::to_string(from) + "&count=3");
    const std::size_t next = document.find("nextSequence=\"") + 14;
    from = std::stoull(document.substr(next));
    for (std::size_t at = document.find("<PathFeedrate"); at != std::string::npos;
         at = document.find("<PathFeedrate", at + 1)) {
      const std::size_t end = document.find('>', at);
      all += document.substr(end + 1, document.find('<', end) - end - 1) + " ";
    }
  }
  EXPECT_EQ(all, "1.5 3 4.5 6 7.5 9 10.5 12 13.5 15 ");
  EXPECT_EQ(from, agent_.buffer().next());
  EXPECT_THAT(get("/sample?from=" + std::to_string(from)), Not(HasSubstr("ComponentStream")));
  // Backwards from the newest.
  const std::string last = get("/sample?count=-2");
  EXPECT_THAT(last, HasSubstr(">ACTIVE<"));
  EXPECT_THAT(last, HasSubstr(">15<"));
  EXPECT_THAT(last, Not(HasSubstr(">13.5<")));
}

TEST_F(AgentTest, PathsSelectItems) {
  const auto selects = [&](const std::string& path, const std::string& id) -> bool {
    return selectedBy(path, "mill")[indexOf(id)];
  };
  EXPECT_TRUE(selects("//Axes", "x_position"));
  EXPECT_FALSE(selects("//Axes", "feed"));
  EXPECT_TRUE(selects("//Linear[@name=\"X\"]", "x_load"));
  EXPECT_FALSE(selects("//Linear[@name=\"X\"]", "y_load"));
  EXPECT_TRUE(selects("//Axes//DataItem[@type=\"LOAD\" and @category='SAMPLE']", "spindle_load"));
  EXPECT_FALSE(selects("//Axes//DataItem[@type=\"LOAD\" and @category='EVENT']|//Path", "spindle_load"));
  EXPECT_TRUE(selects("//Rotary | //Path", "feed"));
  EXPECT_TRUE(selects("/MTConnectDevices/Devices/Device[@name='mill']/DataItems/DataItem", "availability"));
  EXPECT_FALSE(selects("/MTConnectDevices/Devices/Device/DataItems/DataItem", "feed"));
  EXPECT_TRUE(selects("//*[@id='force_peak']", "force_peak"));
  EXPECT_TRUE(selects("//DataItem[@type='s:STABILITY_MARGIN']", "stability_margin"));
}

TEST_F(AgentTest, ConditionsKeepAllThatIsActive) {
  observe("alarms", Activations{{true, "100", "one"}});
  observe("alarms", Activations{{true, "100", "one"}, {false, "200", "two"}});
  const std::string both = get("/current?path=//DataItem[@id='alarms']");
  EXPECT_THAT(both, HasSubstr("<Fault "));
  EXPECT_THAT(both, HasSubstr("<Warning "));
  const std::uint64_t then = agent_.buffer().last();
  observe("alarms", Activations{{false, "200", "two"}});
  const std::string one = get("/current?path=//DataItem[@id='alarms']");
  EXPECT_THAT(one, Not(HasSubstr("<Fault ")));
  EXPECT_THAT(one, HasSubstr("nativeCode=\"200\">two</Warning>"));
  EXPECT_THAT(get("/sample?count=-1"), HasSubstr("<Normal "));  // which clears the first
  EXPECT_THAT(get("/sample?count=-1"), HasSubstr("nativeCode=\"100\""));
  observe("alarms", Activations{});
  EXPECT_THAT(get("/current?path=//DataItem[@id='alarms']"), HasSubstr("<Normal "));
  EXPECT_THAT(get("/current?path=//DataItem[@id='alarms']"), Not(HasSubstr("nativeCode")));
  // The state at an earlier time.
  EXPECT_THAT(get("/current?path=//DataItem[@id='alarms']&at=" + std::to_string(then)), HasSubstr("<Fault "));
}

TEST(Agent, TheBufferForgetsTheOldestAndKeepsItsState) {
  Agent agent(options(100), NOW);
  const std::size_t feed = indexOf("feed"), program = indexOf("program");
  agent.observe({program, NOW, Text{"77"}});
  for (int i = 0; i < 1000; ++i) agent.observe({feed, NOW + i, 1.0 * i});
  const ObservationBuffer& buffer = agent.buffer();
  EXPECT_EQ(buffer.next() - buffer.first(), 100u);
  EXPECT_EQ(buffer.last(), catalogue().size() + 1001);
  const std::string at = agent.answer("/current?at=" + std::to_string(buffer.first()), NOW).document;
  EXPECT_THAT(at, HasSubstr(">77<"));
  EXPECT_THAT(at, HasSubstr(">900<"));
  EXPECT_EQ(agent.answer("/sample?from=1", NOW).status, 400);
}

TEST_F(AgentTest, StreamsSendNewsAtTheirIntervalAndHeartbeatsOtherwise) {
  AgentAnswer answer = agent_.answer(
      "/sample?path=//Path&from=" + std::to_string(begin_) + "&interval=100&heartbeat=1000", NOW);
  ASSERT_TRUE(answer.stream);
  AgentStream& stream = *answer.stream;
  EXPECT_EQ(agent_.next(stream, NOW + 0.5), "");
  observe("x_position", 1.0);  // not selected
  EXPECT_EQ(agent_.next(stream, NOW + 0.6), "");
  const std::string heartbeat = agent_.next(stream, NOW + 1.0);
  EXPECT_THAT(heartbeat, HasSubstr("<Streams>"));
  EXPECT_THAT(heartbeat, Not(HasSubstr("ComponentStream")));
  observe("feed", 3.25);
  EXPECT_EQ(agent_.next(stream, NOW + 1.05), "");
  EXPECT_THAT(agent_.next(stream, NOW + 1.2), HasSubstr(">3.25<"));
  for (int i = 0; i < 2000; ++i) observe("feed", 1.0 * i);
  EXPECT_THROW(agent_.next(stream, NOW + 2.0), AgentError);  // it is behind the buffer
}

TEST_F(AgentTest, AssetsByIdAndType) {
  Asset asset{"coefficients.a.b", "CuttingCoefficients", NOW};
  asset.labels = {{"tool", "<a>"}};
  asset.quantities = {{"ktc", "N/m2", 7.5e8, 1e6}, {"krc", "N/m2", NAN}};
  agent_.store(asset);
  agent_.store({"modes.a", "ToolModes", NOW});
  EXPECT_THAT(get("/asset/coefficients.a.b"),
              HasSubstr("standardDeviation=\"1000000\">750000000</s:Quantity>"));
  EXPECT_THAT(get("/asset/coefficients.a.b"), HasSubstr("<s:Tool>&lt;a&gt;</s:Tool>"));
  EXPECT_THAT(get("/asset/coefficients.a.b"), Not(HasSubstr("krc")));
  EXPECT_THAT(get("/assets?type=ToolModes"), Not(HasSubstr("CuttingCoefficients")));
  EXPECT_THAT(get("/assets"), HasSubstr("assetCount=\"2\""));
  EXPECT_THAT(get("/assets?count=1"), HasSubstr("modes.a"));
  EXPECT_EQ(errorOf("/asset/coefficients.a.b;none"), "ASSET_NOT_FOUND");
}

TEST(Agent, OptionsAreChecked) {
  AgentOptions bad = options();
  bad.device = "my mill";
  EXPECT_THROW(Agent(bad, NOW), Error);
  bad = options();
  bad.uuid.clear();
  EXPECT_THROW(Agent(bad, NOW), Error);
}

}  // namespace
}  // namespace smartmill::exchange
