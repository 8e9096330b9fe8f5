#include "smartmill_loadmeter/identification/identification.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <random>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "../session.h"
#include "smartmill_core/error.h"
#include "smartmill_core/signal/stream_sorter.h"
#include "smartmill_core/testing/coverage.h"
#include "smartmill_loadmeter/calibration/friction_law.h"

namespace smartmill::loadmeter {
namespace {

using ::testing::HasSubstr;
void connect(Session& session, LoadMeterIdentification& identification) {
  session.state = [&](const CncState& s) { identification.handle(s); };
  session.load = [&](const LoadSample& l) { identification.handle(l); };
  session.condition = [&](const CuttingCondition& c) { identification.handle(c); };
}

IdentifyResult identify(LoadMeterIdentification& identification, const IdentifyGoal& goal) {
  IdentifyResult result;
  identification.outputs().result = [&](const IdentifyResult& r) { result = r; };
  identification.handle(goal);
  return result;
}

/// Results of sessions with slots at a speed.
std::vector<IdentifyResult> standardSessions(double rpm, unsigned runs) {
  std::vector<IdentifyResult> results;
  for (unsigned seed = 1; seed <= runs; ++seed) {
    Session session(seed, 2e-4);
    session.ripple = session.any_angle = true;
    LoadMeterIdentification identification(model(), {});
    connect(session, identification);
    runStandardTests(session, rpm);
    results.push_back(identify(identification, {session.now(), "endmill", "aluminium", false, 0}));
    EXPECT_EQ(identification.airCuts().size(), 3u);
  }
  return results;
}

constexpr double ANY_PHASE_RPM = 6100.0;  // the readings of a slot have all phases of the revolution

/// Those at ANY_PHASE_RPM, for the tests that begin with them.
const std::vector<IdentifyResult>& sessionsOfAnyPhase() {
  static const std::vector<IdentifyResult> results = standardSessions(ANY_PHASE_RPM, Coverage::RUNS);
  return results;
}

/// Coverage over sessions. @param factor of the deviations that is detected @param ktc_error, kte_error [1]
/// largest error of a session
void checkCoverage(const std::vector<IdentifyResult>& sessions, double factor, double ktc_error,
                   double kte_error) {
  Coverage ktc, kte;
  for (const IdentifyResult& r : sessions) {
    ASSERT_EQ(r.code, IdentifyResult::Code::ok) << r.message;
    ASSERT_EQ(r.coefficients.tests, 3);
    const CoefficientSet& k = r.coefficients;
    EXPECT_NEAR(k.value.ktc, TRUTH.ktc, ktc_error * TRUTH.ktc);
    EXPECT_NEAR(k.value.kte, TRUTH.kte, kte_error * TRUTH.kte);
    EXPECT_TRUE(std::isnan(k.value.krc));
    EXPECT_NEAR(k.friction_viscous, VISCOUS, 0.02 * VISCOUS);
    EXPECT_EQ(k.source, "load_meter");
    EXPECT_EQ(k.tool, "endmill");
    ktc.add(k.value.ktc - TRUTH.ktc, k.std_dev.ktc);
    kte.add(k.value.kte - TRUTH.kte, k.std_dev.kte);
  }
  EXPECT_TRUE(ktc.isCalibrated(0.0, factor));
  EXPECT_TRUE(kte.isCalibrated(0.0, factor));
}

TEST(LoadMeterIdentification, findsTheTruthWithCalibratedStandardDeviations) {
  // Mean over some 180 readings of 0.22 mV on 0.1..0.3 V: far below one percent.
  checkCoverage(sessionsOfAnyPhase(), 1.5, 0.01, 0.03);
}

// At 100 revolutions per second each reading of a slot has the same phase of the ripple, of which the lag
// leaves 1 / 43 at the 300 Hz of the teeth: a percent of the torque, which a mean over readings does not
// remove and which three feeds amplify to some percent of Ktc and of the smaller Kte. The standard deviations
// must cover it. The study loadmeter_cases has 200 machines.
TEST(LoadMeterIdentification, aliasedReadingsIncreaseTheStandardDeviations) {
  checkCoverage(standardSessions(6000.0, Coverage::FEW), Coverage::FACTOR_OF_FEW, 0.05, 0.2);
}

// Readings every 20 ms without the spindle angle have three phases of a revolution at 4000 rpm, many at 4100.
// Runout reduces the edge in cut at small feeds, so that means alone are biased.
TEST(LoadMeterIdentification, runoutIsEstimatedFromMeansAndRippleOfTheReadings) {
  int inside = 0, runs = 0;
  double worst_bias = 0.0;
  for (const double rpm : {4000.0, 4100.0}) {
    for (const double offset : {0.0, 4e-6, 9e-6, 14e-6}) {
      for (unsigned seed = 1; seed <= 4; ++seed) {
        std::vector<IdentifyResult> results;
        for (const double largest : {3e-5, 0.0}) {
          Session session(seed, 2e-4);
          session.ripple = true;
          session.runout = offset;
          session.runout_angle = 0.7 * seed;
          IdentificationParameters parameters;
          parameters.largest_runout = largest;
          LoadMeterIdentification identification(model(), parameters);
          connect(session, identification);
          for (const double air : {3000.0, 6000.0, 9000.0, 12000.0}) session.air(air, 2.0);
          for (const double feed : {5e-5, 1e-4, 1.5e-4, 2e-4}) session.slot(rpm, feed, 4.0);
          results.push_back(identify(identification, {session.now(), "", "", false, 0}));
          ASSERT_EQ(results.back().code, IdentifyResult::Code::ok) << results.back().message;
        }
        const CoefficientSet& k = results[0].coefficients;
        EXPECT_NEAR(k.value.ktc, TRUTH.ktc, 0.005 * TRUTH.ktc) << rpm << " " << offset << " " << seed;
        EXPECT_NEAR(k.value.ktc, TRUTH.ktc, 3.0 * k.std_dev.ktc) << rpm << " " << offset << " " << seed;
        EXPECT_NEAR(k.value.kte, TRUTH.kte, 3.0 * k.std_dev.kte) << rpm << " " << offset << " " << seed;
        inside += std::abs(k.value.ktc - TRUTH.ktc) < 1.96 * k.std_dev.ktc;
        ++runs;
        worst_bias = std::max(worst_bias, results[1].coefficients.value.ktc / TRUTH.ktc - 1.0);
      }
    }
  }
  EXPECT_GE(inside, runs - 5);   // 95 % of 32 less three sigma of the count
  EXPECT_GT(worst_bias, 0.015);  // bias without the estimate of runout
}

// A second, short session begins with the record of the first: the combination is calibrated and more certain
// than either, and tests that contradict the record are used alone.
TEST(LoadMeterIdentification, knowledgeOfAnEarlierSessionReplacesTests) {
  Coverage ktc, kte;
  for (int run = 0; run < Coverage::RUNS; ++run) {
    const auto identifyWith = [&](const std::optional<CoefficientRecord>& prior) {
      Session session(Coverage::RUNS + 1 + static_cast<unsigned>(run), 2e-4);
      session.ripple = session.any_angle = true;
      LoadMeterIdentification identification(model(), {});
      connect(session, identification);
      for (const double rpm : {2000.0, 8000.0}) session.air(rpm, 2.0);
      for (const double feed : {4e-5, 8e-5}) session.slot(ANY_PHASE_RPM, feed, 4.0);
      IdentifyGoal goal{session.now(), "endmill", "aluminium", false, 0};
      goal.prior = prior;
      return identify(identification, goal);
    };
    const IdentifyResult& first = sessionsOfAnyPhase()[static_cast<std::size_t>(run)];
    ASSERT_EQ(first.code, IdentifyResult::Code::ok) << first.message;
    const IdentifyResult both = identifyWith(first.record);
    ASSERT_EQ(both.code, IdentifyResult::Code::ok) << both.message;
    if (both.coefficients.source == "load_meter") continue;  // one pair in a hundred disagrees by chance
    EXPECT_EQ(both.coefficients.source, "load_meter and database");
    EXPECT_EQ(both.coefficients.tests, 5);
    EXPECT_EQ(both.record.set.tests, 2) << "the database receives the new tests alone";
    EXPECT_LT(both.coefficients.std_dev.ktc, first.coefficients.std_dev.ktc);
    EXPECT_LT(both.coefficients.std_dev.ktc, both.record.set.std_dev.ktc);
    ktc.add(both.coefficients.value.ktc - TRUTH.ktc, both.coefficients.std_dev.ktc);
    kte.add(both.coefficients.value.kte - TRUTH.kte, both.coefficients.std_dev.kte);
    if (run > 0) continue;
    EXPECT_EQ(identifyWith({}).code, IdentifyResult::Code::too_few_tests);
    CoefficientRecord worn = first.record;
    worn.set.value.kte *= 1.5;
    const IdentifyResult alone = identifyWith(worn);
    EXPECT_EQ(alone.coefficients.source, "load_meter");
    EXPECT_EQ(alone.coefficients.value.ktc, alone.record.set.value.ktc);
    EXPECT_THAT(alone.message, HasSubstr("not used: the tests deviate by"));
  }
  EXPECT_TRUE(ktc.isCalibrated());
  EXPECT_TRUE(kte.isCalibrated());
}

TEST(PriorKnowledge, isOfThePairAndYoungerThanTheReset) {
  CoefficientSet set;
  set.tool = "endmill", set.material = "aluminium";
  PriorKnowledge prior;
  const auto isUsed = [&](const char* tool) {
    IdentifyGoal goal{50.0, tool, "aluminium", false, 0};
    prior.use(&goal);
    return goal.prior.has_value();
  };
  EXPECT_FALSE(isUsed(""));
  prior.set(10.0, set, -1.0);
  EXPECT_TRUE(isUsed("endmill"));
  EXPECT_FALSE(isUsed("other"));
  IdentifyGoal reset{5.0, "endmill", "aluminium", true, 0};
  prior.use(&reset);  // arrives late
  EXPECT_TRUE(isUsed("endmill"));
  reset.stamp = 20.0;
  prior.use(&reset);
  EXPECT_FALSE(isUsed("endmill"));
  prior.set(30.0, set, -1.0);
  EXPECT_TRUE(isUsed("endmill"));
  prior.set(40.0, CoefficientSet(), -1.0);
  EXPECT_FALSE(isUsed("endmill"));
}

TEST(LoadMeterIdentification, resetDiscardsTestsAndWrongPlansAreNamed) {
  Session session(1, 2e-4);
  LoadMeterIdentification identification(model(), {});
  connect(session, identification);
  EXPECT_EQ(identify(identification, {session.now(), "", "", false, 0}).code,
            IdentifyResult::Code::too_few_tests);
  session.air(2000.0, 2.0);
  IdentifyResult r = identify(identification, {session.now(), "", "", false, 0});
  EXPECT_EQ(r.code, IdentifyResult::Code::too_few_tests);
  EXPECT_THAT(r.message, HasSubstr("expected air cuts at two or more speeds, 1 usable"));
  session.air(6000.0, 2.0);
  session.slot(6000.0, 3e-5, 2.0);
  session.slot(6000.0, 6e-5, 0.1);  // too short to settle
  r = identify(identification, {session.now(), "", "", false, 0});
  EXPECT_EQ(r.code, IdentifyResult::Code::too_few_tests);
  EXPECT_THAT(r.message, HasSubstr("expected three or more feeds"));
  EXPECT_THAT(r.message, HasSubstr("steady readings, expected 10 or more"));
  runStandardTests(session);
  r = identify(identification, {session.now(), "endmill", "steel", false, 0});
  EXPECT_THAT(r.message, HasSubstr("cuts with another tool or material ignored"));
  r = identify(identification, {session.now(), "", "", true, 0});
  EXPECT_EQ(r.code, IdentifyResult::Code::ok);
  EXPECT_TRUE(identification.cuts().empty());
  EXPECT_TRUE(std::isnan(r.coefficients.value.ktc));
}

TEST(SessionTests, TheNewestOfEachKindAreKept) {
  SessionTests session;
  LoadTest air, cut;
  air.condition.kind = CuttingCondition::Kind::air;
  cut.condition.kind = CuttingCondition::Kind::cut;
  session.add(air);
  for (std::size_t k = 0; k < SessionTests::MOST + 7; ++k) {
    cut.stamp = static_cast<double>(k);
    session.add(cut);
    session.reject(std::to_string(k));
  }
  EXPECT_EQ(session.air_cuts.size(), 1u);
  ASSERT_EQ(session.cuts.size(), SessionTests::MOST);
  EXPECT_EQ(session.cuts.front().stamp, 7.0);
  EXPECT_EQ(session.dropped, 7u);
  ASSERT_EQ(session.rejected.size(), SessionTests::MOST);
  EXPECT_EQ(session.rejected.front(), "7");
}

// A quarter of each second without load: as without a gap. No load at all: bad data.
TEST(LoadMeterIdentification, loadsThatAreNotKnownAreLeftOut) {
  for (const double share : {0.0, 0.25, 1.0}) {
    Session session(1, 2e-4);
    LoadMeterIdentification identification(model(), {});
    connect(session, identification);
    session.load = [&](LoadSample l) {
      if (l.stamp - std::floor(l.stamp) < share) l.spindle_load = NOT_A_NUMBER;
      identification.handle(l);
    };
    runStandardTests(session);
    const IdentifyResult r = identify(identification, {session.now(), "", "", false, 0});
    if (share < 1.0) {
      ASSERT_EQ(r.code, IdentifyResult::Code::ok) << r.message;
      EXPECT_NEAR(r.coefficients.value.ktc, TRUTH.ktc, 4.0 * r.coefficients.std_dev.ktc) << share;
    } else {
      EXPECT_EQ(r.code, IdentifyResult::Code::bad_data);
      EXPECT_THAT(r.message, HasSubstr("load samples not known), expected 10 or more"));
    }
  }
}

TEST(LoadMeterIdentification, withoutAirCutsTheModelsFrictionIsUsedWithItsUncertainty) {
  MachineModel m = model();
  m.spindle->viscous = VISCOUS;
  m.spindle->coulomb = COULOMB;
  m.uncertainty.spindle = 3.0;
  IdentificationParameters parameters;
  parameters.largest_runout = 0.0;  // without air cuts noise may be ripple; checks the friction only
  Session session(2, 2e-4);
  LoadMeterIdentification identification(m, parameters);
  connect(session, identification);
  for (const double feed : {3e-5, 6e-5, 1e-4}) session.slot(6000.0, feed, 4.0);
  const IdentifyResult r = identify(identification, {session.now(), "", "", false, 0});
  ASSERT_EQ(r.code, IdentifyResult::Code::ok) << r.message;
  EXPECT_TRUE(std::isnan(r.coefficients.friction_viscous));
  EXPECT_NEAR(r.coefficients.value.kte, TRUTH.kte, 4.0 * r.coefficients.std_dev.kte);
  // 3 % of a friction torque of 0.30 and 0.067 N m over the torque of one N/m of edge, R N a / 2 = 1.8e-5 m2.
  EXPECT_NEAR(r.coefficients.std_dev.kte, 0.03 * std::hypot(0.298, 0.0671) / 1.8e-5, 60.0);
}

// The same data in another order of arrival give the same result to the last digit.
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
    runStandardTests(session);
    std::stable_sort(items.begin(), items.end(),
                     [](const Item& l, const Item& r) { return l.arrival < r.arrival; });
    for (const Item& item : items) item.push();
    sorter.flush();
    found.push_back(identify(identification, {session.now(), "", "", false, 0}).coefficients.value.ktc);
  }
  EXPECT_EQ(found[0], found[1]);
  EXPECT_EQ(found[0], found[2]);
}

TEST(LoadMeterIdentification, refusesIncompleteModelsAndWrongParameters) {
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

// From five air cuts on the friction law is selected by evidence; a straight line would bias the cuts.
TEST(Tests, theFrictionLawIsSelectedByEvidence) {
  const Spindle spindle = *model().spindle;
  FrictionLaw law;
  law.viscous = VISCOUS;
  law.coulomb = COULOMB;
  law.breakaway = 0.4;
  law.stribeck_speed = units::radPerSecFromRpm(2500.0);
  std::mt19937 random(8);
  std::normal_distribution<double> normal;
  std::vector<LoadTest> air, cuts;
  const auto add = [&](double rpm, double feed) {
    LoadTest t;
    t.condition.tool = ToolGeometry{3, 0.012, 0.6, {}};
    t.condition.engagement = {0.0, units::PI, 0.002, feed};
    t.speed = units::radPerSecFromRpm(rpm);
    t.stamp = 10.0 * static_cast<double>(air.size() + cuts.size());
    const double torque =
        feed > 0.0 ? MechanisticForce(t.condition.tool, TRUTH, t.condition.engagement).mean().torque : 0.0;
    t.voltage = {
        spindle.load_meter_gain * t.speed * (torque + law.torque(t.speed, t.stamp)) + 2e-5 * normal(random),
        2e-5};
    (feed > 0.0 ? cuts : air).push_back(t);
  };
  for (const double rpm : {1000.0, 2000.0, 3000.0, 4500.0, 6000.0, 9000.0, 12000.0}) add(rpm, 0.0);
  for (const double feed : {3e-5, 6e-5, 1e-4}) add(2500.0, feed);
  const CoefficientSet k = identifyFromTests(air, cuts, spindle, 3.0).record.set;
  EXPECT_NEAR(k.value.ktc, TRUTH.ktc, 3.0 * k.std_dev.ktc);
  EXPECT_NEAR(k.value.kte, TRUTH.kte, 3.0 * k.std_dev.kte);
  EXPECT_LT(k.std_dev.kte, 0.02 * TRUTH.kte);
  EXPECT_NEAR(k.friction_viscous, VISCOUS, 0.02 * VISCOUS);
}

TEST(Production, cutsOfASessionAreFollowedWithoutAGoal) {
  LoadMeterIdentification identification(model(), {});
  Session session(5, 2e-4);
  session.state = [&](const CncState& s) { identification.handle(s); };
  session.load = [&](const LoadSample& l) { identification.handle(l); };
  session.condition = [&](const CuttingCondition& c) { identification.handle(c); };
  EXPECT_FALSE(identification.production());
  runStandardTests(session);
  ASSERT_TRUE(identification.production());
  const RecursiveCoefficients& k = *identification.production();
  EXPECT_EQ(k.readings(), 3);
  EXPECT_NEAR(k.ktc(), TRUTH.ktc, 4.0 * k.ktcStd());
  EXPECT_NEAR(k.kte(), TRUTH.kte, 4.0 * k.kteStd());
  EXPECT_LT(k.ktcStd(), 0.05 * TRUTH.ktc);
  const std::string first = session.tool;
  session.tool = "another";
  session.slot(6000.0, 5e-5, 4.0);
  EXPECT_EQ(identification.production()->readings(), 1);
  EXPECT_EQ(identification.productionTool(), "another");
  // The first tool comes back from the magazine.
  session.tool = first;
  session.slot(6000.0, 5e-5, 4.0);
  EXPECT_EQ(identification.production()->readings(), 4);
}

}  // namespace
}  // namespace smartmill::loadmeter
