// Forms of effects without a name against their closed forms.

#include <cmath>

#include <gtest/gtest.h>

#include "smartmill_core/error.h"

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

// Straight edge, one of two teeth in cut: Fz of a chip over a height.
double axialForce(const MachineModel& model, double effective_chip, double height) {
  return (model.cutting->kac * effective_chip + model.cutting->kae) * height;
}

TEST(EffectsWithoutName, forceFollowsTheCourseOverTheChip) {
  // Chip times factor: 40 um at 40 um, 72 um at 120 um, straight between and on.
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

TEST(EffectsWithoutName, aCourseThatFallsIsRefused) {
  EXPECT_THROW(makeEffect(chipEntry({40.0, 80.0}, {1.0, 0.4})), Error);
  EXPECT_THROW(makeEffect(chipEntry({40.0, 30.0}, {1.0, 1.0})), Error);
  EXPECT_THROW(makeEffect(chipEntry({40.0}, {1.0})), Error);
}

TEST(EffectsWithoutName, chipForceSettlesWithTheTimeInCut) {
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

TEST(EffectsWithoutName, aHeightOfTheEdgeCutsHarder) {
  for (const char* from : {"tip", "surface"}) {
    const MachineModel model = with(mill(2, 0.0), {profile(from, 0.5, 1.4)});
    const Record record = run(model, slotCut(EVEN_RPM, DEPTH, FEED), 0.1);
    EXPECT_NEAR(at(record, "fz", 0.5 * PI, EVEN_SPEED),
                axialForce(model, FEED, DEPTH) + 0.4 * model.cutting->kac * FEED * 0.5e-3, 1e-6)
        << from;
  }
  // Lower and upper part together are the whole edge, wherever it is twisted.
  MachineModel harder = mill(4, 30.0);
  for (double CuttingCoefficients::*k :
       {&CuttingCoefficients::ktc, &CuttingCoefficients::krc, &CuttingCoefficients::kac})
    (*harder.cutting).*k *= 1.3;
  const Record whole = run(harder, slotCut(EVEN_RPM, DEPTH, FEED), 0.1);
  const Record parts = run(with(mill(4, 30.0), {profile("tip", 1.2, 1.3), profile("surface", 0.8, 1.3)}),
                           slotCut(EVEN_RPM, DEPTH, FEED), 0.1);
  const Record tip =
      run(with(mill(4, 30.0), {profile("tip", 1.2, 1.3)}), slotCut(EVEN_RPM, DEPTH, FEED), 0.1);
  double apart = 0.0;
  for (std::size_t i = 0; i < whole.size(); i += 37) {
    for (const char* c : {"fx", "fy", "fz"}) EXPECT_NEAR(parts.column(c)[i], whole.column(c)[i], 1e-6);
    apart = std::max(apart, std::abs(tip.column("fy")[i] - whole.column("fy")[i]));
  }
  EXPECT_GT(apart, 5.0);
}

TEST(EffectsWithoutName, theNextToothTakesTheChipOfALostCorner) {
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

// The tool that may vibrate has another kernel; a stiff one cuts as the rigid one does.
TEST(EffectsWithoutName, aStiffToolCutsAsARigidOne) {
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

TEST(EffectsWithoutName, aBentCharacteristicActsOnOneChannel) {
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

TEST(EffectsWithoutName, aChannelSettlesFromTheBeginningOfTheRecord) {
  const Record record = run(
      with(mill(4, 30.0), {effectEntry("empirical:settling", {{"amplitude", -7.0}, {"time_constant_s", 0.04}},
                                       {{"channel", "fy"}})}),
      airCut(3000.0), 0.2);
  for (const std::size_t i : {0u, 1000u, 4000u})
    EXPECT_NEAR(record.column("fy")[i], -7.0 * std::exp(-static_cast<double>(i) / RATE / 0.04), 1e-9);
  EXPECT_EQ(record.column("fx")[1000], 0.0);
}

// The phase of a line is no value of the model: it is found in each record.
TEST(EffectsWithoutName, linesTakeTheirPhaseFromTheRecord) {
  const CampaignTest test = slotCut(EVEN_RPM);
  const Record pure = run(mill(4, 30.0), test, 0.2);
  SimulationOptions options;
  options.noise = false;
  options.phase = 0.0;
  const auto expectFound = [&](const EffectEntry& line, double rate) {
    Record shown = pure;
    std::vector<double>& fz = shown.add("fz");
    fz = pure.column("fz");
    for (std::size_t i = 0; i < fz.size(); ++i)
      fz[i] += 3.5 * std::sin(rate * static_cast<double>(i) / RATE + 1.1);
    const Record found = simulateTest(with(mill(4, 30.0), {line}), test, shown, options);
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

TEST(EffectsWithoutName, everyFormHasItsClassAndCanDoNothing) {
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
