// Empirical effects against their closed forms.

#include <algorithm>
#include <cmath>
#include <complex>

#include <gtest/gtest.h>

#include "smartmill_core/error.h"
#include "smartmill_sim/effects/shelf_filter.h"

#include "effects_rig.h"

namespace smartmill::sim {
namespace {

using units::PI;
using units::TWO_PI;

constexpr double DEPTH = 2e-3, FEED = 1e-4;

EffectEntry chipEntry(const std::vector<double>& h, const std::vector<double>& factor) {
  return effectEntry("empirical:chip_thickness", {}, {}, {{"h_um", h}, {"factor", factor}});
}

EffectEntry profile(const char* from, double height_mm, double factor) {
  return effectEntry("empirical:depth_profile", {{"height_mm", height_mm}, {"factor", factor}},
                     {{"from", from}});
}

// Straight edge, one of two teeth in cut: axial force of a chip over a height.
double axialForce(const MachineModel& model, double effective_chip, double height) {
  return (model.cutting->kac * effective_chip + model.cutting->kae) * height;
}

TEST(EmpiricalEffects, forceFollowsTheCurveOverTheChip) {
  // Chip times factor: 40 um at 40 um, 72 um at 120 um, linear between and beyond.
  const MachineModel model = with(mill(2, 0.0), {chipEntry({40.0, 120.0}, {1.0, 0.6})});
  const Record record = run(model, slotCut(RATE / 360.0 * 60.0, DEPTH, FEED), 0.1);
  const double speed = RATE / 360.0 * TWO_PI;
  EXPECT_NEAR(at(record, "fz", 0.5 * PI, speed), axialForce(model, 64e-6, DEPTH), 1e-6);
  EXPECT_NEAR(at(record, "fz", PI / 6.0, speed), axialForce(model, 44e-6, DEPTH), 1e-6);
  const double thin = FEED * std::sin(units::radFromDeg(10.0));
  EXPECT_NEAR(at(record, "fz", units::radFromDeg(10.0), speed), axialForce(model, thin, DEPTH), 1e-6);
  const Record thick = run(model, slotCut(RATE / 360.0 * 60.0, DEPTH, 1.6e-4), 0.1);
  EXPECT_NEAR(at(thick, "fz", 0.5 * PI, speed), axialForce(model, 88e-6, DEPTH), 1e-6);
}

TEST(EmpiricalEffects, aDecreasingCurveIsRefused) {
  EXPECT_THROW(makeEffect(chipEntry({40.0, 80.0}, {1.0, 0.4})), Error);
  EXPECT_THROW(makeEffect(chipEntry({40.0, 30.0}, {1.0, 1.0})), Error);
  EXPECT_THROW(makeEffect(chipEntry({40.0}, {1.0})), Error);
}

TEST(EmpiricalEffects, chipForceSettlesWithTheTimeInCut) {
  const MachineModel model =
      with(mill(2, 0.0),
           {effectEntry("empirical:cutting_time", {{"amplitude", 0.25}, {"time_constant_s", 0.05}})});
  CampaignTest test = slotCut(EVEN_RPM, DEPTH, FEED);
  const double engage = 4 * REVOLUTION;
  test.engage_time = engage;
  const Record record = run(model, test, 0.3);
  const std::vector<double>& fz = record.column("fz");
  for (const int turn : {5, 8, 13}) {
    const auto i = static_cast<std::size_t>(std::lround((turn * REVOLUTION + 0.25 * REVOLUTION) * RATE));
    const double factor = 1.0 + 0.25 * std::exp(-(record.time[i] - engage) / 0.05);
    EXPECT_NEAR(fz[i], axialForce(model, factor * FEED, DEPTH), 2e-3 * fz[i]) << turn;
  }
}

// The factor is that of the place that the cut has reached, on chip and edge force; between two nodes linear,
// beyond them constant.
TEST(EmpiricalEffects, forceFollowsItsCourseInTheCut) {
  const double revolutions_per_s = 1.0 / REVOLUTION, engage = 4 * REVOLUTION;
  const double feed_mm = 2 * FEED / units::MM * revolutions_per_s;  // per second
  struct Case {
    const char* over;
    double per_second;
  };
  for (const Case& c : {Case{"path", feed_mm}, Case{"time", 1.0}, Case{"revolutions", revolutions_per_s}}) {
    const double from = 0.05 * c.per_second, to = 0.15 * c.per_second;
    const MachineModel model =
        with(mill(2, 0.0), {effectEntry("empirical:force_course", {}, {{"over", c.over}},
                                        {{"at", {from, to}}, {"factor", {0.9, 1.5}}})});
    CampaignTest test = slotCut(EVEN_RPM, DEPTH, FEED);
    test.engage_time = engage;
    const Record record = run(model, test, 0.3);
    const std::vector<double>& fz = record.column("fz");
    for (const int turn : {5, 8, 10, 13}) {
      const auto i = static_cast<std::size_t>(std::lround((turn * REVOLUTION + 0.25 * REVOLUTION) * RATE));
      const double share = std::clamp((record.time[i] - engage - 0.05) / 0.1, 0.0, 1.0);
      const double expected = (0.9 + 0.6 * share) * axialForce(model, FEED, DEPTH);
      EXPECT_NEAR(fz[i], expected, 3e-3 * expected) << c.over << " " << turn;
    }
  }
}

TEST(EmpiricalEffects, aCourseNeedsRisingPlacesWithOneFactorEach) {
  const auto course = [](const std::vector<double>& at, const std::vector<double>& factor) {
    return effectEntry("empirical:force_course", {}, {{"over", "path"}}, {{"at", at}, {"factor", factor}});
  };
  EXPECT_THROW(makeEffect(course({0.0, 0.0}, {1.0, 1.2})), Error);
  EXPECT_THROW(makeEffect(course({0.0, 1.0, 2.0}, {1.0, 1.2})), Error);
  EXPECT_THROW(makeEffect(course({0.0}, {1.0})), Error);
}

TEST(EmpiricalEffects, aHeightOfTheEdgeCutsHarder) {
  for (const char* from : {"tip", "surface"}) {
    const MachineModel model = with(mill(2, 0.0), {profile(from, 0.5, 1.4)});
    const Record record = run(model, slotCut(EVEN_RPM, DEPTH, FEED), 0.1);
    EXPECT_NEAR(at(record, "fz", 0.5 * PI, EVEN_SPEED),
                axialForce(model, FEED, DEPTH) + 0.4 * model.cutting->kac * FEED * 0.5e-3, 1e-6)
        << from;
  }
  // Lower and upper layer together are the whole edge, with helix.
  MachineModel harder = mill(4, 30.0);
  for (double CuttingCoefficients::*k :
       {&CuttingCoefficients::ktc, &CuttingCoefficients::krc, &CuttingCoefficients::kac})
    (*harder.cutting).*k *= 1.3;
  const Record whole = run(harder, slotCut(EVEN_RPM, DEPTH, FEED), 0.1);
  const Record parts = run(with(mill(4, 30.0), {profile("tip", 1.2, 1.3), profile("surface", 0.8, 1.3)}),
                           slotCut(EVEN_RPM, DEPTH, FEED), 0.1);
  const Record tip =
      run(with(mill(4, 30.0), {profile("tip", 1.2, 1.3)}), slotCut(EVEN_RPM, DEPTH, FEED), 0.1);
  double largest_difference = 0.0;
  for (std::size_t i = 0; i < whole.size(); i += 37) {
    for (const char* c : {"fx", "fy", "fz"}) EXPECT_NEAR(parts.column(c)[i], whole.column(c)[i], 1e-6);
    largest_difference = std::max(largest_difference, std::abs(tip.column("fy")[i] - whole.column("fy")[i]));
  }
  EXPECT_GT(largest_difference, 5.0);
}

TEST(EmpiricalEffects, theNextToothCutsTheChipOfALostCorner) {
  const EffectEntry lost = effectEntry("empirical:lost_edge", {{"tooth", 1.0}, {"height_mm", 0.5}});
  const MachineModel model = with(mill(2, 0.0), {lost});
  const Record record = run(model, slotCut(EVEN_RPM, DEPTH, FEED), 0.1);
  EXPECT_NEAR(at(record, "fz", 0.5 * PI, EVEN_SPEED), axialForce(model, FEED, 1.5e-3), 1e-6);
  EXPECT_NEAR(at(record, "fz", 1.5 * PI, EVEN_SPEED),
              axialForce(model, FEED, 1.5e-3) + axialForce(model, 2.0 * FEED, 0.5e-3), 1e-6);
  EXPECT_THROW(
      run(with(mill(2, 0.0), {effectEntry("empirical:lost_edge", {{"tooth", 3.0}, {"height_mm", 0.5}})}),
          slotCut(EVEN_RPM), 0.1),
      Error);
}

// Flexible tools use another algorithm; a stiff one gives the force of the rigid one.
TEST(EmpiricalEffects, aStiffToolCutsAsARigidOne) {
  const std::vector<EffectEntry> effects{
      effectEntry("empirical:lost_edge", {{"tooth", 2.0}, {"height_mm", 0.7}}), profile("surface", 0.4, 1.3),
      chipEntry({40.0, 120.0}, {1.0, 0.8})};
  MachineModel stiff = with(mill(3, 30.0), effects);
  for (ModalModel* axis : {&stiff.tool_tip.x, &stiff.tool_tip.y}) axis->modes = {{900.0, 0.05, 1e-13}};
  const CampaignTest test = slotCut(EVEN_RPM, DEPTH, FEED);
  const Record a = run(stiff, test, 0.12), b = run(with(mill(3, 30.0), effects), test, 0.12);
  for (std::size_t i = 1600; i < a.size(); i += 41) {
    for (const char* c : {"fx", "fy", "fz"})
      EXPECT_NEAR(a.column(c)[i], b.column(c)[i], 0.5) << i << " " << c;
  }
}

TEST(EmpiricalEffects, aNonlinearCharacteristicActsOnOneChannel) {
  const Record pure = run(mill(4, 30.0), slotCut(EVEN_RPM), 0.1);
  const Record bent = run(
      with(mill(4, 30.0), {effectEntry("empirical:curve",
                                       {{"odd_per_kn", 0.2}, {"even_per_kn", -0.1}, {"cubic_per_kn2", 0.3}},
                                       {{"channel", "fx"}})}),
      slotCut(EVEN_RPM), 0.1);
  for (std::size_t i = 0; i < pure.size(); i += 61) {
    const double f = 1e-3 * pure.column("fx")[i];
    EXPECT_NEAR(bent.column("fx")[i], 1e3 * (f + 0.2 * f * std::abs(f) - 0.1 * f * f + 0.3 * f * f * f),
                1e-9);
    EXPECT_EQ(bent.column("fy")[i], pure.column("fy")[i]);
  }
}

TEST(EmpiricalEffects, aChannelSettlesFromTheBeginningOfTheRecord) {
  const Record record = run(
      with(mill(4, 30.0), {effectEntry("empirical:settling", {{"amplitude", -7.0}, {"time_constant_s", 0.04}},
                                       {{"channel", "fy"}})}),
      airCut(3000.0), 0.2);
  for (const std::size_t i : {0u, 1000u, 4000u})
    EXPECT_NEAR(record.column("fy")[i], -7.0 * std::exp(-static_cast<double>(i) / RATE / 0.04), 1e-9);
  EXPECT_EQ(record.column("fx")[1000], 0.0);
}

// The zero of a record is estimated before the engagement and acts throughout.
TEST(EmpiricalEffects, aZeroIsTakenFromTheRecordBeforeItsCut) {
  CampaignTest test = slotCut(EVEN_RPM);
  test.engage_time = 4 * REVOLUTION;
  const Record pure = run(mill(4, 30.0), test, 0.2);
  Record indicated = pure;
  for (std::size_t i = 0; i < pure.size(); ++i)
    indicated.add("fy")[i] = pure.column("fy")[i] + (pure.time[i] < *test.engage_time ? 4.0 : 400.0);
  SimulationOptions options;
  options.noise = false;
  options.phase = 0.0;
  const MachineModel model =
      with(mill(4, 30.0), {effectEntry("empirical:zero", {{"share", 0.75}}, {{"channel", "fy"}})});
  const Record found = simulateTest(model, test, indicated, options);
  for (std::size_t i = 0; i < pure.size(); i += 53) {
    EXPECT_NEAR(found.column("fy")[i], pure.column("fy")[i] + 3.0, 1e-6);
    EXPECT_NEAR(found.column("fx")[i], pure.column("fx")[i], 1e-9);
  }
}

TEST(EmpiricalEffects, aZeroIsUnknownWhereARecordBeginsInTheCut) {
  CampaignTest test = slotCut(EVEN_RPM);
  test.engage_time.reset();
  const Record pure = run(mill(4, 30.0), test, 0.2);
  Record indicated = pure;
  for (double& f : indicated.add("fy")) f += 4.0;
  SimulationOptions options;
  options.noise = false;
  options.phase = 0.0;
  const EffectEntry zero = effectEntry("empirical:zero", {{"share", 1.0}}, {{"channel", "fy"}});
  const Record found = simulateTest(with(mill(4, 30.0), {zero}), test, indicated, options);
  EXPECT_NEAR(found.column("fy")[777], pure.column("fy")[777], 1e-9);
}

// The phase of a line is not a value of the model: it is estimated from each record.
TEST(EmpiricalEffects, linesTakeTheirPhaseFromTheRecord) {
  const CampaignTest test = slotCut(EVEN_RPM);
  const Record pure = run(mill(4, 30.0), test, 0.2);
  SimulationOptions options;
  options.noise = false;
  options.phase = 0.0;
  const auto expectFound = [&](const EffectEntry& line, double rate) {
    Record indicated = pure;
    std::vector<double>& fz = indicated.add("fz");
    fz = pure.column("fz");
    for (std::size_t i = 0; i < fz.size(); ++i)
      fz[i] += 3.5 * std::sin(rate * static_cast<double>(i) / RATE + 1.1);
    const Record found = simulateTest(with(mill(4, 30.0), {line}), test, indicated, options);
    for (std::size_t i = 0; i < fz.size(); i += 53) {
      EXPECT_NEAR(found.column("fz")[i], fz[i], 1e-6) << line.name;
      EXPECT_NEAR(found.column("fx")[i], pure.column("fx")[i], 1e-9);
    }
  };
  expectFound(effectEntry("empirical:tone", {{"frequency_hz", 36.8}, {"amplitude", 3.5}},
                          {{"channel", "fz"}, {"while", "turning"}}),
              TWO_PI * 36.8);
  expectFound(effectEntry("empirical:order", {{"order", 0.5}, {"amplitude", 3.5}}, {{"channel", "fz"}}),
              0.5 * EVEN_SPEED);
}

// Straight edges: one tooth in cut at a time.
TEST(EmpiricalEffects, eachToothHasItsFactor) {
  const auto table = [](const char* of) {
    return effectEntry("empirical:tooth_factor", {}, {{"of", of}}, {{"factor", {1.0, 1.3}}});
  };
  const CuttingCoefficients k = *mill(2, 0.0).cutting;
  const Record chip = run(with(mill(2, 0.0), {table("chip")}), slotCut(EVEN_RPM, DEPTH, FEED), 0.1);
  EXPECT_NEAR(at(chip, "fz", 0.5 * PI, EVEN_SPEED), (k.kac * FEED + k.kae) * DEPTH, 1e-6);
  EXPECT_NEAR(at(chip, "fz", 1.5 * PI, EVEN_SPEED), (1.3 * k.kac * FEED + k.kae) * DEPTH, 1e-6);
  const Record edge = run(with(mill(2, 0.0), {table("edge")}), slotCut(EVEN_RPM, DEPTH, FEED), 0.1);
  EXPECT_NEAR(at(edge, "fz", 1.5 * PI, EVEN_SPEED), (k.kac * FEED + 1.3 * k.kae) * DEPTH, 1e-6);
  // Equal factors are a change of the coefficients.
  const Record alike =
      run(with(mill(3, 30.0),
               {effectEntry("empirical:tooth_factor", {}, {{"of", "chip"}}, {{"factor", {0.8, 0.8, 0.8}}})}),
          slotCut(EVEN_RPM, DEPTH, FEED), 0.1);
  const Record less =
      run(with(mill(3, 30.0), {chipEntry({40.0, 80.0}, {0.8, 0.8})}), slotCut(EVEN_RPM, DEPTH, FEED), 0.1);
  for (std::size_t i = 0; i < alike.size(); i += 41) {
    for (const char* c : {"fx", "fy", "fz"}) EXPECT_NEAR(alike.column(c)[i], less.column(c)[i], 2e-3) << c;
  }
  EXPECT_THROW(run(with(mill(4, 0.0), {table("chip")}), slotCut(EVEN_RPM), 0.1), Error);
}

TEST(EmpiricalEffects, theEdgeRunsInWithItsCuttingTime) {
  const MachineModel model =
      with(mill(2, 0.0), {effectEntry("empirical:edge_life", {{"amplitude", 0.4}, {"time_constant_s", 90.0}},
                                      {{"of", "chip"}})});
  CampaignTest test = slotCut(EVEN_RPM, DEPTH, FEED);
  test.cut_time_before = 120.0;
  EXPECT_NEAR(at(run(model, test, 0.1), "fz", 0.5 * PI, EVEN_SPEED),
              axialForce(model, FEED * (1.0 + 0.4 * (1.0 - std::exp(-120.0 / 90.0))), DEPTH), 1e-3);
}

TEST(EmpiricalEffects, channelsStepAndDriftByTheirClock) {
  const auto indicated = [](const EffectEntry& entry, std::size_t i) {
    return run(with(mill(4, 30.0), {entry}), airCut(3000.0), 0.2).column("fy")[i];  // begins at 100 s
  };
  const auto time = [](std::size_t i) { return static_cast<double>(i) / RATE; };
  const auto step = [](const char* clock, double at) {
    return effectEntry("empirical:step", {{"at_s", at}, {"amplitude", 4.0}},
                       {{"channel", "fy"}, {"clock", clock}});
  };
  EXPECT_EQ(indicated(step("record", 0.1), 2559), 0.0);
  EXPECT_EQ(indicated(step("record", 0.1), 2561), 4.0);
  EXPECT_EQ(indicated(step("machine", 99.0), 0), 4.0);
  EXPECT_EQ(indicated(step("machine", 100.1), 2000), 0.0);
  const auto ramp = [](const char* clock) {
    return effectEntry("empirical:ramp", {{"per_min", -30.0}}, {{"channel", "fy"}, {"clock", clock}});
  };
  EXPECT_NEAR(indicated(ramp("record"), 4000), -0.5 * time(4000), 1e-9);
  EXPECT_NEAR(indicated(ramp("machine"), 4000), -0.5 * (100.0 + time(4000)), 1e-9);
  const EffectEntry approach =
      effectEntry("empirical:approach", {{"amplitude", 6.0}, {"time_constant_s", 50.0}}, {{"channel", "fy"}});
  EXPECT_NEAR(indicated(approach, 4000), 6.0 * (1.0 - std::exp(-(100.0 + time(4000)) / 50.0)), 1e-9);
  CampaignTest timeless = airCut(3000.0);
  timeless.start_time.reset();
  EXPECT_THROW(run(with(mill(4, 30.0), {ramp("machine")}), timeless, 0.1), Error);
}

// Above x + (below - above) / (1 + i f / corner) x.
TEST(EmpiricalEffects, aShelfHasDifferentGainsBelowAndAboveItsCorner) {
  const Shelf shelf{200.0, 0.7, 1.4};
  for (const double f : {2.0, 60.0, 200.0, 900.0}) {
    ShelfFilter filter(shelf, 1.0 / RATE);
    const auto samples = static_cast<std::size_t>(std::lround(std::ceil(0.1 * f) / f * RATE));
    double sine = 0.0, cosine = 0.0;
    for (std::size_t i = 0; i < 2 * samples; ++i) {
      const double angle = TWO_PI * f * static_cast<double>(i) / RATE, y = filter.step(std::sin(angle));
      if (i < samples) continue;
      sine += 2.0 * y * std::sin(angle) / static_cast<double>(samples);
      cosine += 2.0 * y * std::cos(angle) / static_cast<double>(samples);
    }
    const double q = f / 200.0, low = 1.0 / (1.0 + q * q);
    EXPECT_NEAR(sine, 1.4 - 0.7 * low, 3e-3) << f;
    EXPECT_NEAR(cosine, 0.7 * q * low, 3e-3) << f;
  }
  const Record record =
      run(with(mill(4, 30.0),
               {effectEntry("empirical:transfer", {{"corner_hz", 200.0}, {"below", 0.5}, {"above", 0.5}},
                            {{"channel", "fx"}})}),
          slotCut(EVEN_RPM), 0.1);
  const Record pure = run(mill(4, 30.0), slotCut(EVEN_RPM), 0.1);
  for (std::size_t i = 0; i < pure.size(); i += 61) {
    EXPECT_NEAR(record.column("fx")[i], 0.5 * pure.column("fx")[i], 1e-9);
    EXPECT_EQ(record.column("fy")[i], pure.column("fy")[i]);
  }
}

// Added to the channel: the other channel times gain / (1 - q^2 + 2 i zeta q).
TEST(EmpiricalEffects, aModeTransmitsOneForceToAnother) {
  const auto resonance = [](const char* to) {
    return effectEntry("empirical:resonance",
                       {{"frequency_hz", 640.0}, {"damping_ratio", 0.05}, {"gain", 0.8}},
                       {{"channel", to}, {"from", "fx"}});
  };
  const MachineModel model = mill(3, 30.0);
  const Record pure = run(model, slotCut(EVEN_RPM), 0.4);
  const auto line = [](const Record& record, const char* c, int order) {  // over the last revolutions
    std::complex<double> sum;
    const std::size_t turn = 512, from = record.size() - 4 * turn;
    for (std::size_t i = from; i < record.size(); ++i)
      sum += record.column(c)[i] * std::polar(1.0, -TWO_PI * order * static_cast<double>(i) / 512.0);
    return sum / (2.0 * static_cast<double>(turn));
  };
  const Record other = run(with(model, {resonance("fz")}), slotCut(EVEN_RPM), 0.4),
               itself = run(with(model, {resonance("fx")}), slotCut(EVEN_RPM), 0.4);
  for (const int order : {3, 6, 9, 15}) {
    const double q = order * RATE / 512.0 / 640.0;
    const std::complex<double> mode = 0.8 / std::complex<double>(1.0 - q * q, 2.0 * 0.05 * q);
    const std::complex<double> x = line(pure, "fx", order), z = line(pure, "fz", order);
    EXPECT_LT(std::abs(line(other, "fz", order) - (z + mode * x)), 0.01 * std::abs(mode * x)) << order;
    EXPECT_LT(std::abs(line(itself, "fx", order) - (0.2 + mode) * x), 0.01 * std::abs(mode * x)) << order;
    EXPECT_EQ(line(other, "fx", order), x);
  }
}

// The begin of the bursts is not a value of the model.
TEST(EmpiricalEffects, burstsTakeTheirTimesFromTheRecord) {
  const CampaignTest test = slotCut(EVEN_RPM);
  const EffectEntry bursts =
      effectEntry("empirical:bursts",
                  {{"period_s", 0.0237}, {"frequency_hz", 900.0}, {"decay_s", 3e-3}, {"amplitude", 8.0}},
                  {{"channel", "fz"}});
  SimulationOptions options;
  options.noise = false;
  options.phase = 0.0;
  const Record pure = run(mill(4, 30.0), test, 0.2);
  for (const double first : {0.0013, 0.0112, 0.0229}) {
    Record indicated = pure;
    std::vector<double>& fz = indicated.add("fz");
    fz = pure.column("fz");
    for (std::size_t i = 0; i < fz.size(); ++i) {
      const double since = std::fmod(static_cast<double>(i) / RATE - first + 0.0237, 0.0237);
      fz[i] += 8.0 * std::exp(-since / 3e-3) * std::sin(TWO_PI * 900.0 * since);
    }
    const Record found = simulateTest(with(mill(4, 30.0), {bursts}), test, indicated, options);
    double squares = 0.0;
    for (std::size_t i = 0; i < fz.size(); ++i) squares += std::pow(found.column("fz")[i] - fz[i], 2);
    EXPECT_LT(std::sqrt(squares / static_cast<double>(fz.size())), 0.1) << first;
  }
}

// 3 cos(a) + 4 sin(a) independent of the feed, cos(2 a) + 2 sin(2 a) at 0.1 mm per tooth, twice that at 0.2
// mm.
TEST(EmpiricalEffects, aForceOverTheRevolutionGrowsWithTheFeed) {
  const MachineModel machine = mill(2, 0.0);
  const EffectEntry table = effectEntry(
      "empirical:revolution",
      {{"share", 0.5}, {"speed_rpm", EVEN_RPM}, {"depth_mm", 1e3 * DEPTH}, {"chip_um", 100.0}}, {},
      {{"order", {1.0, 2.0}},
       {"fx_n", {3.0, 4.0, 0.0, 0.0, 0.0, 0.0, 1.0, 2.0}},
       {"fy_n", std::vector<double>(8, 0.0)},
       {"fz_n", std::vector<double>(8, 0.0)}});
  const auto added = [&](const CampaignTest& test, double angle) {
    return at(run(with(machine, {table}), test, 0.05), "fx", angle, EVEN_SPEED) -
           at(run(machine, test, 0.05), "fx", angle, EVEN_SPEED);
  };
  for (const double angle : {0.0, 0.25 * PI, 0.5 * PI, 1.25 * PI}) {
    const double always = 3.0 * std::cos(angle) + 4.0 * std::sin(angle);
    const double growing = std::cos(2.0 * angle) + 2.0 * std::sin(2.0 * angle);
    EXPECT_NEAR(added(slotCut(EVEN_RPM, DEPTH, 1e-4), angle), 0.5 * (always + growing), 1e-6);
    EXPECT_NEAR(added(slotCut(EVEN_RPM, DEPTH, 2e-4), angle), 0.5 * (always + 2.0 * growing), 1e-6);
  }
  // Zero at other depths and speeds, and in air.
  EXPECT_EQ(added(slotCut(EVEN_RPM, 1.5 * DEPTH, 1e-4), 0.5 * PI), 0.0);
  EXPECT_EQ(added(slotCut(1.5 * EVEN_RPM, DEPTH, 1e-4), 0.5 * PI), 0.0);
  EXPECT_EQ(added(airCut(EVEN_RPM), 0.5 * PI), 0.0);
  EffectEntry short_list = table;
  short_list.lists["fx_n"].pop_back();
  EXPECT_THROW(makeEffect(short_list), Error);
}

// 8 cos(a) in addition at 0.2 mm per tooth, 0 at 0.1 and 0.4 mm and beyond, linear between them.
TEST(EmpiricalEffects, aForceOverTheRevolutionBendsOverTheFeed) {
  const MachineModel machine = mill(2, 0.0);
  EffectEntry table = effectEntry(
      "empirical:revolution",
      {{"share", 0.5}, {"speed_rpm", EVEN_RPM}, {"depth_mm", 1e3 * DEPTH}, {"chip_um", 100.0}}, {},
      {{"order", {1.0}},
       {"fx_n", std::vector<double>(4, 0.0)},
       {"fy_n", std::vector<double>(4, 0.0)},
       {"fz_n", std::vector<double>(4, 0.0)},
       {"bend_um", {100.0, 200.0, 400.0}},
       {"fx_bend_n", {0.0, 0.0, 8.0, 0.0, 0.0, 0.0}},
       {"fy_bend_n", std::vector<double>(6, 0.0)},
       {"fz_bend_n", std::vector<double>(6, 0.0)}});
  const auto added = [&](double chip) {
    const CampaignTest test = slotCut(EVEN_RPM, DEPTH, chip);
    return at(run(with(machine, {table}), test, 0.05), "fx", 0.0, EVEN_SPEED) -
           at(run(machine, test, 0.05), "fx", 0.0, EVEN_SPEED);
  };
  EXPECT_NEAR(added(1.5e-4), 0.5 * 4.0, 1e-6);
  EXPECT_NEAR(added(2e-4), 0.5 * 8.0, 1e-6);
  EXPECT_NEAR(added(3e-4), 0.5 * 4.0, 1e-6);
  EXPECT_EQ(added(0.5e-4), 0.0);
  EXPECT_EQ(added(5e-4), 0.0);
  table.lists["bend_um"] = {100.0, 100.0, 400.0};
  EXPECT_THROW(makeEffect(table), Error);
}

TEST(EmpiricalEffects, everyFormHasItsClassAndANullEffect) {
  const MachineModel model = mill(4, 30.0);
  const EffectScope scope{model, {"fx", "fy", "fz", "load_meter"}};
  const Record pure = run(model, slotCut(4200.0), 0.03);
  for (const EffectKind& kind : empiricalCatalogue()) {
    for (const EffectForm& form : formsOf(kind, scope)) {
      EffectForm::Values null;
      for (const Coordinate& c : form.coordinates) null.push_back(c.null);
      EffectEntry entry = form.entry(null);
      if (kind.form == "order") entry.numbers["order"] = 0.5;
      const Record record = run(with(model, {entry}), slotCut(4200.0), 0.03);
      for (const char* c : {"fx", "fy", "fz"})
        EXPECT_NEAR(record.column(c)[700], pure.column(c)[700], 1e-6) << form.title() << " " << c;
    }
  }
}

}  // namespace
}  // namespace smartmill::sim
