#include "smartmill_stability/coupling/tool_assembly.h"

#include <cmath>
#include <random>

#include <gtest/gtest.h>

#include "smartmill_core/units.h"

namespace smartmill::stability {
namespace {

using units::TWO_PI;

constexpr double LOW = 100.0, HIGH = 4000.0, STEP = 4.0;

/// [as Receptance] A spindle with three modes, deflecting and tilting; symmetric.
Receptance spindleAt(double f) {
  struct {
    double frequency, damping, gain, slope;  // [Hz], [1], [m/N], [1/m] rotation over displacement
  } const modes[] = {{650.0, 0.04, 8e-9, -6.0}, {1100.0, 0.03, 5e-9, 9.0}, {2600.0, 0.03, 3e-9, -20.0}};
  Receptance sum = Receptance::Zero();
  for (const auto& m : modes) {
    const std::complex<double> h =
        m.gain / std::complex<double>(1.0 - std::pow(f / m.frequency, 2), 2.0 * m.damping * f / m.frequency);
    Receptance shape;
    shape << 1.0, m.slope, m.slope, m.slope * m.slope;
    sum += h * shape;
  }
  sum(0, 0) += 1e-9;
  sum(1, 1) += 2e-7;
  return sum;
}

SpindleReceptances spindle() {
  SpindleReceptances s;
  for (double f = LOW; f <= HIGH; f += STEP) {
    s.frequency.push_back(f);
    s.value.push_back(spindleAt(f));
  }
  return s;
}

const BeamMaterial STEEL = beamMaterial("steel");

Gauge gauge() {
  Gauge g;
  g.segments = {{0.08, 0.04, 0.0, STEEL, {}}, {0.03, 0.063, 0.0, STEEL, {}}};
  g.second_point = 0.06;
  return g;
}

/// The FRFs that are measured on the gauge: force and response at two points, by joining the part before the
/// second point to the rest, loaded there.
GaugeTaps taps(bool with_second) {
  GaugeTaps t;
  for (FrequencyResponse* frf : {&t.direct, &t.cross}) frf->unit = "m/N";
  FrequencyResponse second;
  second.unit = "m/N";
  for (double f = LOW; f <= HIGH; f += STEP) {
    const BeamSegment front{0.06, 0.04, 0.0, STEEL, {}};
    const EndReceptances a = beamReceptances(front, f);
    const Receptance back =
        joined(beamReceptances(
                   std::vector<BeamSegment>{{0.02, 0.04, 0.0, STEEL, {}}, {0.03, 0.063, 0.0, STEEL, {}}}, f),
               spindleAt(f), Receptance::Zero());
    const Receptance k = (a.r22 + back).inverse();
    for (FrequencyResponse* frf : {&t.direct, &t.cross, &second}) frf->frequency.push_back(f);
    t.direct.value.push_back((a.r11 - a.r12 * k * a.r21)(0, 0));
    t.cross.value.push_back((a.r12 * k * back)(0, 0));
    second.value.push_back((a.r22 * k * back)(0, 0));
  }
  if (with_second) t.second = second;
  return t;
}

ToolDescription tool(double stickout = 0.06) {
  return {"em12", stickout, 0.012, 0.026, 4, 0.5, 0.8, beamMaterial("carbide")};
}

std::vector<BeamSegment> holder() {
  return {{0.03, 0.03, 0.012, STEEL, beamMaterial("carbide")}, {0.04, 0.045, 0.0, STEEL, {}}};
}

ContactEstimate contact(double k, double kr) {
  ContactEstimate c = ContactEstimate::prior();
  c.log_value << std::log(k), std::log(kr), std::log(300.0), std::log(0.3), 0.0;
  return c;
}

TEST(Spindle, FollowsFromThreeFrfsOfTheGauge) {
  const SpindleReceptances found = spindleReceptances(gauge(), taps(true), LOW, HIGH);
  for (std::size_t i = 0; i < found.value.size(); i += 20) {
    const Receptance expected = spindleAt(found.frequency[i]);
    for (int r = 0; r < 2; ++r)
      for (int c = 0; c < 2; ++c)
        EXPECT_LT(std::abs(found.value[i](r, c) - expected(r, c)), 1e-5 * std::abs(expected(r, c)))
            << found.frequency[i];
  }
}

// Two FRFs: exact displacement, approximate rotation.
TEST(Spindle, FollowsApproximatelyFromFiniteDifferences) {
  const SpindleReceptances found = spindleReceptances(gauge(), taps(false), LOW, HIGH);
  const ToolAssembly exact(spindle(), holder()), approximate(found, holder());
  const TipPeak a = tipPeak(exact.tip(tool(), contact(8e7, 3e4))),
                b = tipPeak(approximate.tip(tool(), contact(8e7, 3e4)));
  EXPECT_NEAR(b.frequency, a.frequency, 0.05 * a.frequency);
}

TEST(Spindle, RefusesUnequalLinesAndUnits) {
  GaugeTaps t = taps(true);
  t.cross.frequency[3] += 1.0;
  EXPECT_THROW(spindleReceptances(gauge(), t, LOW, HIGH), std::exception);
  t = taps(true);
  t.direct.unit = "m/s2/N";
  EXPECT_THROW(spindleReceptances(gauge(), t, LOW, HIGH), std::exception);
  Gauge g = gauge();
  g.second_point = 0.2;
  EXPECT_THROW(spindleReceptances(g, taps(true), LOW, HIGH), std::exception);
}

TEST(ToolAssembly, PeakOfASingleModeIsThatOfTheMode) {
  FrequencyResponse frf;
  frf.unit = "m/N";
  const Mode mode{987.0, 0.02, 2e-8};
  for (double f = 900.0; f < 1100.0; f += 4.0) {
    frf.frequency.push_back(f);
    frf.value.push_back(mode.response(f));
  }
  const TipPeak peak = tipPeak(frf);
  EXPECT_NEAR(peak.frequency, 987.0 * std::sqrt(1.0 - 2.0 * 0.0004), 0.1);
  EXPECT_NEAR(peak.flexibility, 2e-8 / (2.0 * 0.02), 2e-3 * 5e-7);
  EXPECT_NEAR(peak.damping, 0.02, 4e-4);
}

TEST(ToolAssembly, LongerToolsAreSlowerAndMoreFlexible) {
  const ToolAssembly machine(spindle(), holder());
  TipPeak last = tipPeak(machine.tip(tool(0.05), contact(8e7, 3e4)));
  for (const double stickout : {0.07, 0.09}) {
    const TipPeak peak = tipPeak(machine.tip(tool(stickout), contact(8e7, 3e4)));
    EXPECT_LT(peak.frequency, last.frequency);
    EXPECT_GT(peak.flexibility, last.flexibility);
    last = peak;
  }
}

TEST(ToolAssembly, FitsTheContactOfATappedTool) {
  const ToolAssembly machine(spindle(), holder());
  const ContactEstimate truth = contact(4e7, 2e4);
  FrequencyResponse measured = machine.tip(tool(), truth);
  std::mt19937_64 random(3);
  std::normal_distribution<double> noise(0.0, 0.007);
  for (std::complex<double>& v : measured.value)
    v *= std::complex<double>(1.0 + noise(random), noise(random));
  const ContactEstimate found = machine.fit({{tool(), measured}}, ContactEstimate::prior());
  // Rotation dominates at the face of a holder; translation is ten times stiffer and determined less.
  EXPECT_NEAR(found.value(rotation), 2e4, 0.05 * 2e4);
  for (int i = 0; i < contact_unknowns; ++i)
    EXPECT_LT(std::abs(found.log_value[i] - truth.log_value[i]), 4.0 * std::sqrt(found.covariance(i, i)))
        << i;
  // Another tool follows within its standard deviation.
  ToolDescription longer = tool(0.08);
  const TipPeak expected = tipPeak(machine.tip(longer, truth));
  const TipPrediction predicted = machine.predict(longer, found.forAnotherTool(0.1));
  EXPECT_NEAR(predicted.peak.frequency, expected.frequency, 0.01 * expected.frequency);
  EXPECT_LT(std::abs(predicted.peak.frequency - expected.frequency), 3.0 * predicted.frequency_std);
  EXPECT_GT(predicted.frequency_std, 0.001 * expected.frequency);
}

TEST(ToolAssembly, ModesOfThePredictionReproduceItsPeak) {
  const ToolAssembly machine(spindle(), holder());
  const TipPrediction p = machine.predict(tool(0.07), contact(4e7, 2e4).forAnotherTool(0.1));
  const ModalModel model = modesOf(p);
  ASSERT_FALSE(model.modes.empty());
  EXPECT_NEAR(std::abs(model.response(p.peak.frequency)), p.peak.flexibility, 0.1 * p.peak.flexibility);
}

TEST(ToolAssembly, RefusesAnImpossibleTool) {
  const ToolAssembly machine(spindle(), holder());
  ToolDescription bad = tool();
  bad.fluted_length = 0.1;
  try {
    machine.tip(bad, ContactEstimate::prior());
    FAIL();
  } catch (const std::exception& error) {
    EXPECT_NE(std::string(error.what()).find("tool em12: fluted length"), std::string::npos) << error.what();
  }
}

}  // namespace
}  // namespace smartmill::stability
