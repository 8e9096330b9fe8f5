#include "smartmill_loadmeter/identification.h"

#include <cmath>
#include <functional>
#include <random>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "smartmill_core/cutting/mechanistic.h"
#include "smartmill_core/error.h"
#include "smartmill_core/signal/stream_sorter.h"
#include "smartmill_core/units.h"
#include "smartmill_loadmeter/campaign_identification.h"

namespace smartmill::loadmeter {
namespace {

using ::testing::HasSubstr;
using units::radPerSecFromRpm;

const CuttingCoefficients TRUTH{953e6, 0, 0, 17.3e3, 0, 0};
constexpr double VISCOUS = 4.743e-4, COULOMB = 0.0671, RATE = 50.0;

MachineModel model() {
  MachineModel m;
  m.file = "model.yaml";
  Spindle s;
  s.viscous = 9e-4;  // wrong: air cuts decide
  s.coulomb = 0.5;
  s.load_meter_gain = 3.88e-4;
  s.load_meter_bandwidth = 7.0;
  s.load_meter_resolution = 3e-4;
  s.load_meter_full_scale = 8.0;
  m.spindle = s;
  return m;
}

/// A machine that goes through air cuts and slots; everything it says is handed over in stamp order.
class Session {
 public:
  Session(unsigned seed, double noise) : random_(seed), noise_(noise) {}

  std::function<void(const CncState&)> state = [](const CncState&) {};
  std::function<void(const LoadSample&)> load = [](const LoadSample&) {};
  std::function<void(const CuttingCondition&)> condition = [](const CuttingCondition&) {};

  void air(double rpm, double seconds) {
    announce(CuttingCondition::Kind::air, rpm, 0.0, "air_" + std::to_string(static_cast<int>(rpm)));
    turnTo(rpm);
    run(seconds, 0.0, 0.0);
    announce(CuttingCondition::Kind::none, 0.0, 0.0, "");
    run(0.1, 0.0, 0.0);  // two conditions of one stamp would have no order
  }

  void slot(double rpm, double feed, double seconds) {
    announce(CuttingCondition::Kind::cut, rpm, feed, "slot_" + std::to_string(feed));
    turnTo(rpm);
    const double speed = radPerSecFromRpm(rpm) / units::TWO_PI * 3 * feed;  // [m/s]
    position_ = 0.1 - 0.3 * speed;
    run(0.3, speed, 0.0);  // in air, then at once in full cut
    const Engagement e{0.0, units::PI, 0.002, feed};
    run(seconds, speed, MechanisticForce(TOOL, TRUTH, e).mean().torque);
    run(0.3, speed, 0.0);
    announce(CuttingCondition::Kind::none, 0.0, 0.0, "");
    run(0.1, 0.0, 0.0);
  }

  double now() const { return time_; }
  double length = 0.0;
  std::string tool = "endmill", material = "aluminium";

 private:
  void announce(CuttingCondition::Kind kind, double rpm, double feed, const std::string& name) {
    CuttingCondition c;
    c.stamp = time_;
    c.kind = kind;
    c.name = name;
    c.tool_name = tool;
    c.material = material;
    c.tool = TOOL;
    c.engagement = {0.0, units::PI, 0.002, feed};
    c.spindle_speed = radPerSecFromRpm(rpm);
    c.steady_from = {0.1, 0.2, -0.1};
    c.steady_to = {0.1 + 4.0 * radPerSecFromRpm(rpm) / units::TWO_PI * 3 * feed, 0.2, -0.1};
    condition(c);
  }

  void turnTo(double rpm) {
    const double goal = radPerSecFromRpm(rpm), step = 800.0 / RATE;
    while (std::abs(goal - speed_) > step) {
      speed_ += goal > speed_ ? step : -step;
      tick(0.0, 5.0);  // accelerating takes torque
    }
    speed_ = goal;
  }

  void run(double seconds, double feed_speed, double torque) {
    for (int i = 0; i < std::lround(seconds * RATE); ++i) tick(feed_speed, torque);
  }

  void tick(double feed_speed, double torque) {
    time_ += 1.0 / RATE;
    position_ += feed_speed / RATE;
    const double power = (torque + VISCOUS * speed_ + COULOMB) * speed_;
    const double a = std::exp(-1.0 / RATE / timeConstant(7.0));
    lagged_ = a * lagged_ + (1.0 - a) * 3.88e-4 * power;
    CncState s;
    s.stamp = time_ - 0.004;
    s.connected = true;
    s.motion = feed_speed > 0.0;
    s.position = {position_, 0.2, -0.1};
    state(s);
    LoadSample l;
    l.stamp = time_;
    l.spindle_speed = speed_ * (1.0 + 0.001 * normal_(random_));
    l.spindle_load = 3e-4 * std::round((lagged_ + noise_ * normal_(random_)) / 3e-4) / 8.0;
    load(l);
  }

  const ToolGeometry TOOL{3, 0.012, units::radFromDeg(35.0), {}};
  std::mt19937 random_;
  std::normal_distribution<double> normal_;
  double noise_;
  double time_ = 1000.0, position_ = 0.0, speed_ = 0.0, lagged_ = 0.0;
};

void connect(Session& session, LoadMeterIdentification& identification) {
  session.state = [&](const CncState& s) { identification.handle(s); };
  session.load = [&](const LoadSample& l) { identification.handle(l); };
  session.condition = [&](const CuttingCondition& c) { identification.handle(c); };
}

void takeThrough(Session& session) {
  for (const double rpm : {2000.0, 6000.0, 12000.0}) session.air(rpm, 3.0);
  for (const double feed : {3e-5, 6e-5, 1e-4}) session.slot(6000.0, feed, 4.0);
}

IdentifyResult ask(LoadMeterIdentification& identification, const IdentifyGoal& goal) {
  IdentifyResult result;
  identification.onResult([&](const IdentifyResult& r) { result = r; });
  identification.handle(goal);
  return result;
}

TEST(LoadMeterIdentification, findsTheTruthWithHonestStandardDeviations) {
  const int runs = 100;
  int inside_c = 0, inside_e = 0;
  for (int run = 0; run < runs; ++run) {
    Session session(static_cast<unsigned>(run + 1), 2e-4);
    LoadMeterIdentification identification(model(), {});
    connect(session, identification);
    takeThrough(session);
    const IdentifyResult r = ask(identification, {session.now(), "endmill", "aluminium", false, 0});
    ASSERT_EQ(r.code, IdentifyResult::Code::ok) << r.message;
    ASSERT_EQ(identification.airCuts().size(), 3u);
    ASSERT_EQ(r.coefficients.tests, 3);
    const CoefficientSet& k = r.coefficients;
    // A mean over some 180 readings of 0.22 mV on 0.1..0.3 V: far below one percent.
    EXPECT_NEAR(k.value.ktc, TRUTH.ktc, 0.01 * TRUTH.ktc);
    EXPECT_NEAR(k.value.kte, TRUTH.kte, 0.03 * TRUTH.kte);
    EXPECT_TRUE(std::isnan(k.value.krc));
    EXPECT_NEAR(k.friction_viscous, VISCOUS, 0.02 * VISCOUS);
    EXPECT_EQ(k.source, "load_meter");
    EXPECT_EQ(k.tool, "endmill");
    inside_c += std::abs(k.value.ktc - TRUTH.ktc) < 1.96 * k.std_dev.ktc;
    inside_e += std::abs(k.value.kte - TRUTH.kte) < 1.96 * k.std_dev.kte;
  }
  EXPECT_GE(inside_c, 90);
  EXPECT_GE(inside_e, 90);
}

TEST(LoadMeterIdentification, resetForgetsAndWrongPlansAreNamed) {
  Session session(1, 2e-4);
  LoadMeterIdentification identification(model(), {});
  connect(session, identification);
  EXPECT_EQ(ask(identification, {session.now(), "", "", false, 0}).code, IdentifyResult::Code::too_few_tests);
  session.air(2000.0, 2.0);
  IdentifyResult r = ask(identification, {session.now(), "", "", false, 0});
  EXPECT_EQ(r.code, IdentifyResult::Code::too_few_tests);
  EXPECT_THAT(r.message, HasSubstr("air cuts at two or more speeds are due, 1 usable"));
  session.air(6000.0, 2.0);
  session.slot(6000.0, 3e-5, 2.0);
  session.slot(6000.0, 6e-5, 0.1);  // too short to settle
  r = ask(identification, {session.now(), "", "", false, 0});
  EXPECT_EQ(r.code, IdentifyResult::Code::too_few_tests);
  EXPECT_THAT(r.message, HasSubstr("at least three are due"));
  EXPECT_THAT(r.message, HasSubstr("steady readings, 10 are due"));
  takeThrough(session);
  r = ask(identification, {session.now(), "endmill", "steel", false, 0});
  EXPECT_THAT(r.message, HasSubstr("cuts with another tool or material left out"));
  r = ask(identification, {session.now(), "", "", true, 0});
  EXPECT_EQ(r.code, IdentifyResult::Code::ok);
  EXPECT_TRUE(identification.cuts().empty());
  EXPECT_TRUE(std::isnan(r.coefficients.value.ktc));
}

TEST(LoadMeterIdentification, aLoadThatIsNoNumberIsBadData) {
  Session session(1, 2e-4);
  LoadMeterIdentification identification(model(), {});
  connect(session, identification);
  int n = 0;
  session.load = [&](LoadSample l) {
    if (++n == 300) l.spindle_load = NOT_A_NUMBER;
    identification.handle(l);
  };
  takeThrough(session);
  const IdentifyResult r = ask(identification, {session.now(), "", "", false, 0});
  EXPECT_EQ(r.code, IdentifyResult::Code::bad_data);
  EXPECT_THAT(r.message, HasSubstr("is not a finite number"));
}

TEST(LoadMeterIdentification, withoutAirCutsTheModelsFrictionStandsWithItsUncertainty) {
  MachineModel m = model();
  m.spindle->viscous = VISCOUS;
  m.spindle->coulomb = COULOMB;
  m.uncertainty.spindle = 3.0;
  Session session(2, 2e-4);
  LoadMeterIdentification identification(m, {});
  connect(session, identification);
  for (const double feed : {3e-5, 6e-5, 1e-4}) session.slot(6000.0, feed, 4.0);
  const IdentifyResult r = ask(identification, {session.now(), "", "", false, 0});
  ASSERT_EQ(r.code, IdentifyResult::Code::ok) << r.message;
  EXPECT_TRUE(std::isnan(r.coefficients.friction_viscous));
  EXPECT_NEAR(r.coefficients.value.kte, TRUTH.kte, 4.0 * r.coefficients.std_dev.kte);
  // 3 % of a friction torque of 0.30 and 0.067 N m over the torque of one N/m of edge, R N a / 2 = 1.8e-5 m2.
  EXPECT_NEAR(r.coefficients.std_dev.kte, 0.03 * std::hypot(0.298, 0.0671) / 1.8e-5, 60.0);
}

// The same data through the sorter in another order of arrival: the same figures to the last digit.
TEST(LoadMeterIdentification, arrivalDoesNotMatter) {
  std::vector<double> found;
  for (unsigned seed = 0; seed < 3; ++seed) {
    struct Item {
      double arrival;
      std::function<void()> push;
    };
    std::vector<Item> items;
    std::mt19937 random(seed);
    std::uniform_real_distribution<double> delay(0.0, seed ? 0.04 : 0.0);
    LoadMeterIdentification identification(model(), {});
    StreamSorter sorter(0.05);
    const auto states = sorter.addRegular("cnc/state"), loads = sorter.addRegular("cnc/load");
    const auto events = sorter.addEvents("cut/condition");
    Session session(9, 2e-4);
    session.state = [&](const CncState& s) {
      items.push_back({s.stamp + delay(random),
                       [&, s] { sorter.push(states, s.stamp, [&, s] { identification.handle(s); }); }});
    };
    session.load = [&](const LoadSample& l) {
      items.push_back({l.stamp + delay(random),
                       [&, l] { sorter.push(loads, l.stamp, [&, l] { identification.handle(l); }); }});
    };
    session.condition = [&](const CuttingCondition& c) {
      items.push_back({c.stamp + delay(random),
                       [&, c] { sorter.push(events, c.stamp, [&, c] { identification.handle(c); }); }});
    };
    takeThrough(session);
    std::stable_sort(items.begin(), items.end(),
                     [](const Item& l, const Item& r) { return l.arrival < r.arrival; });
    for (const Item& item : items) item.push();
    sorter.flush();
    found.push_back(ask(identification, {session.now(), "", "", false, 0}).coefficients.value.ktc);
  }
  EXPECT_EQ(found[0], found[1]);
  EXPECT_EQ(found[0], found[2]);
}

TEST(LoadMeterIdentification, refusesWhatItCannotUse) {
  MachineModel m = model();
  m.spindle->load_meter_full_scale.reset();
  try {
    LoadMeterIdentification identification(m, {});
    FAIL();
  } catch (const Error& error) {
    EXPECT_THAT(error.what(), HasSubstr("model.yaml: spindle.load_meter_full_scale_v is missing"));
  }
  IdentificationParameters p;
  p.settle_time_constants = 2.0;
  try {
    p.validate();
    FAIL();
  } catch (const Error& error) {
    EXPECT_THAT(error.what(), HasSubstr("settle_time_constants: 2 is out of range"));
  }
}

}  // namespace
}  // namespace smartmill::loadmeter
