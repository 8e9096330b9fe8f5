#include "smartmill_exchange/items/translator.h"

#include <cmath>
#include <map>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "smartmill_core/error.h"
#include "smartmill_core/units.h"
#include "smartmill_exchange/items/catalogue.h"

namespace smartmill::exchange {
namespace {

using ::testing::HasSubstr;

constexpr double START = 1.7e9;  // [s]

template <class Message>
Message stamped(double stamp) {
  Message message;
  message.header.stamp.sec = static_cast<std::uint32_t>(stamp);
  message.header.stamp.nsec = static_cast<std::uint32_t>(std::llround(1e9 * (stamp - std::floor(stamp))));
  return message;
}

class TranslatorTest : public ::testing::Test {
 protected:
  template <class Message>
  void take(const Message& message) {
    translator_.take(message, message.header.stamp.sec + 1e-9 * message.header.stamp.nsec);
  }
  double number(const std::string& id) const { return std::get<double>(last_.at(id).value); }
  std::string text(const std::string& id) const { return std::get<Text>(last_.at(id).value).text; }
  bool unavailable(const std::string& id) const {
    return !last_.count(id) || std::holds_alternative<Unavailable>(last_.at(id).value);
  }
  Activations active(const std::string& id) const { return std::get<Activations>(last_.at(id).value); }

  plain::CncState state(double stamp = START) const {
    auto m = stamped<plain::CncState>(stamp);
    m.connected = true;
    m.mode = plain::CncState::MODE_DNC;
    m.run = plain::CncState::RUN_START;
    m.program = 1234;
    m.sequence = 50;
    m.axes = {"X", "Y", "Z"};
    m.position = {0.1, -0.25, 0.003};
    m.spindle_speed = units::radPerSecFromRpm(6000.0);
    m.feed = 0.02;
    return m;
  }
  plain::CuttingCondition cut() const {
    auto m = stamped<plain::CuttingCondition>(START);
    m.kind = plain::CuttingCondition::CUT;
    m.name = "slot_1";
    m.tool = "end_mill";
    m.material = "al7050";
    m.teeth = 2;
    m.axial_depth = 2e-3;
    m.exit_angle = units::PI;
    return m;
  }
  plain::StabilityChart chart() const {
    auto m = stamped<plain::StabilityChart>(START);
    m.tool = "end_mill";
    m.material = "al7050";
    m.exit_angle = units::PI;
    m.spindle_speed = {600.0, 700.0};
    m.depth_limit = {2e-3, 4e-3};
    return m;
  }

  std::map<std::string, Observation> last_;
  std::map<std::string, int> count_;
  std::vector<Asset> assets_;
  Translator translator_{TranslatorParameters{},
                         {[this](const Observation& o) {
                            last_[catalogue()[o.item].id] = o;
                            ++count_[catalogue()[o.item].id];
                          },
                          [this](const Asset& asset) { assets_.push_back(asset); }}};
};

TEST_F(TranslatorTest, StateOfTheController) {
  take(state());
  EXPECT_EQ(text("availability"), "AVAILABLE");
  EXPECT_EQ(text("execution"), "ACTIVE");
  EXPECT_EQ(text("mode"), "AUTOMATIC");
  EXPECT_EQ(text("program"), "1234");
  EXPECT_EQ(text("line"), "50");
  EXPECT_EQ(text("emergency_stop"), "ARMED");
  EXPECT_DOUBLE_EQ(number("x_position"), 100.0);  // [mm]
  EXPECT_DOUBLE_EQ(number("y_position"), -250.0);
  EXPECT_NEAR(number("spindle_speed"), 6000.0, 1e-9);
  EXPECT_DOUBLE_EQ(number("feed"), 20.0);
  EXPECT_DOUBLE_EQ(last_.at("feed").time, START);
  EXPECT_TRUE(active("connection").empty());
}

TEST_F(TranslatorTest, AControllerThatDoesNotAnswerHasNoValues) {
  take(state());
  plain::CncState lost = state(START + 1.0);
  lost.connected = false;
  take(lost);
  for (const char* id : {"availability", "execution", "program", "feed", "x_position", "spindle_speed"})
    EXPECT_TRUE(unavailable(id)) << id;
  ASSERT_EQ(active("connection").size(), 1u);
  EXPECT_TRUE(active("connection")[0].fault);
}

TEST_F(TranslatorTest, AlarmsAreActivationsWithTheirNumbers) {
  auto m = stamped<plain::CncAlarms>(START);
  m.alarms.resize(2);
  m.alarms[0].number = 417;
  m.alarms[0].axis = 2;
  m.alarms[0].text = "SERVO ALARM";
  m.alarms[1].number = 100;
  take(m);
  EXPECT_EQ(active("alarms"), (Activations{{true, "417.2", "SERVO ALARM"}, {true, "100", ""}}));
  take(stamped<plain::CncAlarms>(START + 1.0));
  EXPECT_TRUE(active("alarms").empty());
}

TEST_F(TranslatorTest, SamplesKeepTheirPeriodAndEventsDoNot) {
  for (int i = 0; i < 50; ++i) {  // 1 s at 50 Hz; sample_period is 0.1 s
    plain::CncState m = state(START + 0.02 * i);
    m.feed = 1e-3 * i;
    m.sequence = i;
    take(m);
  }
  EXPECT_EQ(count_["feed"], 10);
  EXPECT_EQ(count_["line"], 50);
  EXPECT_EQ(count_["program"], 1);  // equal values are not repeated
}

TEST_F(TranslatorTest, SilentTopicsBecomeUnavailableAndRestartsForgetEverything) {
  take(state());
  auto load = stamped<plain::LoadSample>(START);
  load.spindle_load = 0.42;
  take(load);
  EXPECT_DOUBLE_EQ(number("spindle_load"), 42.0);
  take(cut());
  take(state(START + 1.9));
  translator_.tick(START + 2.1);
  EXPECT_TRUE(unavailable("spindle_load"));
  EXPECT_FALSE(unavailable("feed"));
  EXPECT_EQ(text("tool"), "end_mill");  // latched topics stay
  take(state(START - 100.0));
  EXPECT_TRUE(unavailable("tool"));
  EXPECT_FALSE(unavailable("feed"));
}

// The limit of the chart rises from 2 mm at 600 rad/s to 4 mm at 700 rad/s: 2.5663706 mm at 6000 rpm, 28.3 %
// above 2 mm.
TEST_F(TranslatorTest, StabilityMarginIsThatOfTheChart) {
  take(cut());
  take(chart());
  take(state());
  const double limit = 2.0 + 2.0 * (200.0 * units::PI - 600.0) / 100.0;
  EXPECT_NEAR(number("depth_limit"), limit, 1e-9);
  EXPECT_NEAR(number("stability_margin"), 100.0 * (limit / 2.0 - 1.0), 1e-9);
  plain::CuttingCondition other = cut();
  other.exit_angle = 0.5 * units::PI;  // another engagement than that of the chart
  take(other);
  take(state(START + 0.2));
  EXPECT_TRUE(unavailable("stability_margin"));
  plain::StabilityChart infinite = chart();
  infinite.depth_limit = {INFINITY, INFINITY};
  take(cut());
  take(infinite);
  take(state(START + 0.4));
  EXPECT_TRUE(unavailable("depth_limit"));
}

TEST_F(TranslatorTest, ChatterIsAFaultWithItsFrequency) {
  auto m = stamped<plain::ChatterState>(START);
  m.condition = "slot_1";
  m.valid = true;
  m.frequency = 843.2;
  m.energy_ratio = 0.25;
  m.severity = 12.5;
  take(m);
  EXPECT_TRUE(active("chatter").empty());
  m.chatter = true;
  m.header.stamp.sec += 1;
  take(m);
  ASSERT_EQ(active("chatter").size(), 1u);
  EXPECT_THAT(active("chatter")[0].text, HasSubstr("843 Hz"));
  EXPECT_DOUBLE_EQ(number("chatter_frequency"), 843.2);
  EXPECT_DOUBLE_EQ(number("chatter_energy"), 25.0);
  EXPECT_DOUBLE_EQ(number("chatter_force"), 12.5);
  m.valid = false;
  m.header.stamp.sec += 1;
  take(m);
  EXPECT_TRUE(unavailable("chatter"));
  EXPECT_TRUE(unavailable("chatter_frequency"));
}

TEST_F(TranslatorTest, CoefficientsAndModesAreAssetsWithTheirDeviations) {
  auto m = stamped<plain::CuttingCoefficients>(START);
  m.tool = "end mill/3";
  m.material = "al7050";
  m.ktc = 796e6;
  m.ktc_std = 4e6;
  m.krc = NAN;
  m.friction_coulomb = 0.3;
  m.friction_viscous = 1e-3;
  take(m);
  ASSERT_EQ(assets_.size(), 1u);
  EXPECT_EQ(assets_[0].id, "coefficients.end_mill_3.al7050");
  EXPECT_EQ(assets_[0].quantities[0].std_dev, 4e6);
  EXPECT_EQ(text("asset_changed"), assets_[0].id);
  EXPECT_EQ(std::get<Text>(last_.at("asset_changed").value).asset_type, "CuttingCoefficients");
  take(state());
  EXPECT_NEAR(number("spindle_friction"), 0.3 + 1e-3 * 200.0 * units::PI, 1e-9);

  auto modes = stamped<plain::ModalModel>(START);
  modes.tool = "end_mill";
  modes.point = "tool_tip";
  modes.direction = "x";
  modes.unit = "m/N";
  modes.modes.resize(2);
  modes.modes[1].frequency = 930.0;
  modes.modes[1].frequency_std = 0.4;
  take(modes);
  ASSERT_EQ(assets_.size(), 2u);
  EXPECT_EQ(assets_[1].id, "modes.end_mill.tool_tip.x");
  EXPECT_EQ(assets_[1].groups.at(1).quantities.at(0).value, 930.0);
  EXPECT_EQ(assets_[1].groups.at(1).quantities.at(0).std_dev, 0.4);
}

TEST_F(TranslatorTest, DriftOfTheSpindleIsAWarning) {
  auto m = stamped<plain::SpindleHealth>(START);
  m.measured = "end_mill tool_tip x";
  m.changes.resize(2);
  m.changes[0].quantity = "damping of the mode at 930 Hz";
  m.changes[0].first = 0.02;
  m.changes[0].now = 0.03;
  m.changes[0].deviations = 6.0;
  m.changes[0].drifted = true;
  take(m);
  ASSERT_EQ(active("spindle_health").size(), 1u);
  EXPECT_FALSE(active("spindle_health")[0].fault);
  EXPECT_THAT(active("spindle_health")[0].text, HasSubstr("was 0.02, is 0.03, 6 standard deviations"));
}

TEST(Observation, TimesAreUtcWithMicroseconds) {
  EXPECT_EQ(timeText(0.0), "1970-01-01T00:00:00.000000Z");
  EXPECT_EQ(timeText(951782400.25), "2000-02-29T00:00:00.250000Z");
  EXPECT_EQ(timeText(NAN), "1970-01-01T00:00:00.000000Z");
}

}  // namespace
}  // namespace smartmill::exchange
