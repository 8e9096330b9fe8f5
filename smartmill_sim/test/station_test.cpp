// The hammer station: the tool as a beam on its spindle, the sensor in front of a round, fluted tool, the
// solenoid.

#include <algorithm>
#include <cmath>
#include <numeric>
#include <random>
#include <vector>

#include <gtest/gtest.h>
#include <Eigen/Core>

#include "smartmill_core/error.h"
#include "smartmill_core/math/linear_algebra.h"
#include "smartmill_core/units.h"
#include "smartmill_sim/world/gap_sensor.h"
#include "smartmill_sim/world/hammer_station.h"
#include "smartmill_sim/world/solenoid.h"
#include "smartmill_sim/world/tool_structure.h"

namespace smartmill::sim {
namespace {

constexpr double PI = units::PI;

// A carbide tool, diameter 12 mm, stickout 60 mm.
RoundBeam slender() {
  RoundBeam beam;
  beam.length = 60e-3;
  beam.shank_diameter = beam.diameter = 12e-3;
  beam.young = 5.8e11;
  beam.density = 14500.0;
  beam.shear = false;
  return beam;
}

double inertiaOf(const RoundBeam& b) {
  return PI * std::pow(b.shank_diameter, 4) / 64.0;
}
double massPerLength(const RoundBeam& b) {
  return b.density * 0.25 * PI * b.shank_diameter * b.shank_diameter;
}

/// Natural frequencies [Hz] of the beam with `held` fixed degrees of freedom at the first node.
std::vector<double> frequencies(const RoundBeam& beam, Eigen::Index held) {
  const RoundBeam::Matrices m = beam.matrices();
  const Eigen::Index n = m.mass.rows() - held;
  const auto of_mass = linear::symmetricEigensystem(m.mass.bottomRightCorner(n, n));
  const Eigen::MatrixXd root =
      of_mass.vectors * of_mass.values.cwiseSqrt().cwiseInverse().asDiagonal() * of_mass.vectors.transpose();
  const auto modes = linear::symmetricEigensystem(root * m.stiffness.bottomRightCorner(n, n) * root);
  std::vector<double> f;
  for (Eigen::Index k = 0; k < n; ++k) f.push_back(std::sqrt(std::max(0.0, modes.values[k])) / (2.0 * PI));
  return f;
}

// Euler and Bernoulli: cos b cosh b = 1 free, -1 clamped (Blevins).
TEST(RoundBeam, HasTheClosedFormFrequencies) {
  const RoundBeam beam = slender();
  const double unit =
      std::sqrt(beam.young * inertiaOf(beam) / massPerLength(beam)) / (2.0 * PI * beam.length * beam.length);
  const std::vector<double> free = frequencies(beam, 0), clamped = frequencies(beam, 2);
  EXPECT_LT(free[1], 1e-2 * free[2]);  // two motions as a rigid body
  int k = 2;
  for (const double b : {4.730041, 7.853205, 10.995608}) {
    EXPECT_NEAR(free[static_cast<std::size_t>(k)] / (unit * b * b), 1.0, 5e-5) << k;
    ++k;
  }
  k = 0;
  for (const double b : {1.875104, 4.694091, 7.854757}) {
    EXPECT_NEAR(clamped[static_cast<std::size_t>(k)] / (unit * b * b), 1.0, 5e-5) << k;
    ++k;
  }
}

// F L^3 / 3 E I, and with shear F L / (kappa G A) more; two sections by the unit load theorem.
TEST(RoundBeam, HasTheClosedFormCompliance) {
  for (const bool shear : {false, true}) {
    RoundBeam beam = slender();
    beam.shear = shear;
    beam.fluted = 25e-3;
    beam.diameter = 9e-3;
    const RoundBeam::Matrices m = beam.matrices();
    const Eigen::Index n = m.mass.rows() - 2;
    Eigen::VectorXd force = Eigen::VectorXd::Zero(n);
    force[n - 2] = 100.0;
    const Eigen::VectorXd bent = linear::solveSymmetric(m.stiffness.bottomRightCorner(n, n), force);
    const double i_shank = PI * std::pow(12e-3, 4) / 64.0, i_flute = PI * std::pow(9e-3, 4) / 64.0;
    const double L = 60e-3, f = 25e-3;
    double expected = 100.0 / (3.0 * beam.young) * (f * f * f / i_flute + (L * L * L - f * f * f) / i_shank);
    if (shear) {
      const double nu = beam.poisson, kappa = 6.0 * (1.0 + nu) / (7.0 + 6.0 * nu);
      const double g = beam.young / (2.0 * (1.0 + nu));
      expected += 100.0 / (kappa * g) * (f / (0.25 * PI * 81e-6) + (L - f) / (0.25 * PI * 144e-6));
    }
    EXPECT_NEAR(bent[n - 2] / expected, 1.0, 1e-9);
  }
}

// A rigid tool on one mode without rotation: its mass adds to the modal mass.
TEST(CoupledTool, RigidToolAddsItsMass) {
  RoundBeam beam = slender();
  beam.young = 1e16;
  const FaceMode mode{800.0, 0.02, 5e7, 0.0};
  const CoupledTool tool(beam, {mode}, {1e13, 1e9, 0.0}, 0.0);
  const double mass = 5e7 / std::pow(2.0 * PI * 800.0, 2), more = massPerLength(beam) * beam.length;
  // The compliance of joint and tool is 1e-5 of the mode's.
  EXPECT_NEAR(tool.frequencies()[0], std::sqrt(5e7 / (mass + more)) / (2.0 * PI), 0.01);
  // c stays, so the ratio falls with the root of k m.
  const ModalModel tip = tool.between(0.0, 0.0, 5000.0);
  EXPECT_NEAR(tip.modes[0].damping_ratio, 0.02 * std::sqrt(mass / (mass + more)), 1e-5);
  EXPECT_NEAR(tip.staticGain() * 5e7, 1.0, 1e-3);
}

using Pair = Eigen::Matrix2d;

/// Closed form of the free beam in steady vibration: displacement and slope at both ends for unit forces and
/// moments at both ends; w = a cos + b sin + c cosh + d sinh.
Eigen::Matrix4d freeReceptance(const RoundBeam& beam, double f) {
  const double ei = beam.young * inertiaOf(beam), w = 2.0 * PI * f;
  const double b = std::sqrt(w * std::sqrt(massPerLength(beam) / ei)), l = b * beam.length;
  const auto derivative = [&](int order, double x) {
    const double c = std::cos(x), s = std::sin(x), ch = std::cosh(x), sh = std::sinh(x);
    const double scale = std::pow(b, order);
    switch (order) {
      case 0:
        return Eigen::RowVector4d(c, s, ch, sh);
      case 1:
        return Eigen::RowVector4d(scale * Eigen::RowVector4d(-s, c, sh, ch));
      case 2:
        return Eigen::RowVector4d(scale * Eigen::RowVector4d(-c, -s, ch, sh));
      default:
        return Eigen::RowVector4d(scale * Eigen::RowVector4d(s, -c, sh, ch));
    }
  };
  Eigen::Matrix4d load, deflection;
  load << ei * derivative(3, 0.0), -ei * derivative(2, 0.0), -ei * derivative(3, l), ei * derivative(2, l);
  deflection << derivative(0, 0.0), derivative(1, 0.0), derivative(0, l), derivative(1, l);
  return deflection * load.inverse();
}

// The sum of modes against receptance coupling with the closed form of the beam.
TEST(CoupledTool, MatchesReceptanceCouplingOfClosedForms) {
  const RoundBeam beam = slender();
  const std::vector<FaceMode> spindle{{650.0, 1e-5, 9e7, 6.0}, {1400.0, 1e-5, 7e7, -12.0}};
  const Joint joint{2e8, 5e4, 0.0};
  const CoupledTool tool(beam, spindle, joint, 0.0);
  const ModalModel tip = tool.between(0.0, 0.0, 40000.0), cross = tool.between(0.0, 60e-3, 40000.0);
  for (const double f : {100.0, 500.0, 900.0, 1700.0, 2600.0, 4000.0, 6000.0}) {
    const Eigen::Matrix4d h = freeReceptance(beam, f);
    Pair compliance = h.topLeftCorner<2, 2>();
    compliance(0, 0) += 1.0 / joint.across;
    compliance(1, 1) += 1.0 / joint.tilting;
    for (const FaceMode& mode : spindle) {
      const Eigen::Vector2d shape(1.0, mode.slope);
      compliance += shape * shape.transpose() / (mode.stiffness * (1.0 - std::pow(f / mode.frequency, 2)));
    }
    const Eigen::Matrix2d back = compliance.inverse();
    const Eigen::RowVector2d tip_face = h.block<1, 2>(2, 0);
    const Eigen::Vector2d face_tip = h.block<2, 1>(0, 2);
    const double tip_tip = h(2, 2) - tip_face.dot(back * face_tip);
    EXPECT_NEAR(tip.response(f).real() / tip_tip, 1.0, 2e-3) << f;
    const double face = h(2, 0) - tip_face.dot(back * h.block<2, 1>(0, 0));
    EXPECT_NEAR(cross.response(f).real() / face, 1.0, 3e-3) << f;
  }
}

ToolGeometry mill(int teeth, double diameter) {
  ToolGeometry tool;
  tool.teeth = teeth;
  tool.diameter = diameter;
  tool.helix = units::radFromDeg(30.0);
  return tool;
}

// Error of eq. 4.44: it assumes the shape of a cantilever for every mode.
TEST(ToolStructure, ModesDifferInTheirRatioOfTipToHammer) {
  StationTraits traits;
  traits.structure = "beam";
  traits.plane_turn = 0.1;
  traits.plane_ratio = 1.05;
  const ToolStructure structure(traits, mill(4, 16e-3), 70e-3);
  const ModalModel direct = structure.between(0, 0.0, 0, 0.0), measured = structure.between(0, 0.0, 0, 15e-3);
  double least = 10.0, most = -10.0;
  for (std::size_t k = 0; k < direct.modes.size(); ++k) {
    if (direct.modes[k].frequency > 5000.0) break;
    ASSERT_GT(direct.modes[k].gain, 0.0);
    const double ratio = measured.modes[k].gain / direct.modes[k].gain;
    least = std::min(least, ratio);
    most = std::max(most, ratio);
  }
  EXPECT_LT(least, 0.75);
  EXPECT_GT(most, least + 0.1);
  // Reciprocity, and the static deflection of all modes together.
  const ModalModel xy = structure.between(0, 3e-3, 1, 18e-3), yx = structure.between(1, 18e-3, 0, 3e-3);
  for (const double f : {0.0, 700.0, 2500.0})
    EXPECT_NEAR(std::abs(xy.response(f) - yx.response(f)), 0.0, 1e-9 * std::abs(xy.response(f)));
}

smartmill::HammerStation stationModel() {
  smartmill::HammerStation h;
  h.offset = 15e-3;
  h.peak_force = 200.0;
  h.contact_time = 0.4e-3;
  h.gap_at_zero_volt = 250e-6;
  h.gain_volt = h.range_volt = 10.0;
  h.flute_depth = 1e-3;
  h.position["x"] = {0.2, 0.0, -0.12};
  return h;
}

// A disc in front of a cylinder: C ~ integral of dA / (g + R - sqrt(R^2 - y^2)), here by Simpson's rule.
TEST(GapSensor, IntegratesOverACylinder) {
  StationTraits traits;
  traits.electrode = 3e-3;
  smartmill::HammerStation station = stationModel();
  station.flute_depth = 0.0;
  double last = 20.0;
  for (const double diameter : {40e-3, 20e-3, 10e-3, 6e-3}) {
    const ToolSurface surface(traits, mill(4, diameter), 0.0);
    GapSensor sensor(traits, station, 0.5 * PI);
    sensor.setTarget(surface, 0.3, 0.0, 0.0);
    const double r = 1.5e-3, R = 0.5 * diameter, g = 200e-6;
    double capacity = 0.0;
    constexpr int STEPS = 4000;
    for (int i = 0; i <= STEPS; ++i) {
      const double angle = PI * i / STEPS, y = -r * std::cos(angle);  // dA = 2 r^2 sin^2
      const double weight = i == 0 || i == STEPS ? 1.0 : i % 2 == 1 ? 4.0 : 2.0;
      capacity += weight * 2.0 * r * r * std::pow(std::sin(angle), 2) / (g + R - std::sqrt(R * R - y * y));
    }
    capacity *= PI / STEPS / 3.0 / (PI * r * r);
    const double expected = 10.0 * (250e-6 * capacity - 1.0);
    EXPECT_NEAR(sensor.voltage(g), expected, 1e-3) << diameter;
    EXPECT_LT(sensor.voltage(g), last);
    EXPECT_NEAR(sensor.clearance(g), g, 5e-6);
    last = sensor.voltage(g);
  }
}

TEST(GapSensor, APointSensorAtAnEdgeHasTheNominalCurve) {
  const StationTraits traits;
  const smartmill::HammerStation station = stationModel();
  const ToolSurface surface(traits, mill(4, 19e-3), station.flute_depth);
  GapSensor sensor(traits, station, 0.5 * PI);
  sensor.setTarget(surface, 0.5 * PI, 0.0, 0.0);
  for (const double gap : {150e-6, 250e-6, 500e-6})
    EXPECT_NEAR(sensor.voltage(gap), 10.0 * (250e-6 / gap - 1.0), 1e-9);
  // Halfway to the next tooth: nearly the floor of the flute.
  sensor.setTarget(surface, 0.25 * PI, 0.0, 0.0);
  EXPECT_NEAR(sensor.clearance(100e-6), 1.1e-3, 0.02e-3);
  // Helix: at a height z the edge faces the sensor after a further rotation of the spindle by z tan(helix) /
  // R.
  const double lag = 7.5e-3 * std::tan(units::radFromDeg(30.0)) / 9.5e-3;
  sensor.setTarget(surface, 0.5 * PI + lag, 7.5e-3, 0.0);
  EXPECT_NEAR(sensor.clearance(100e-6), 100e-6, 1e-9);
}

TEST(GapSensor, LowTeethEccentricityAndHousing) {
  StationTraits traits;
  traits.tooth_low = {0.0, 30e-6, 0.0, 10e-6};
  traits.eccentricity = 20e-6;
  traits.housing = 8e-3;
  const smartmill::HammerStation station = stationModel();
  const ToolSurface surface(traits, mill(4, 19e-3), station.flute_depth);
  GapSensor sensor(traits, station, 0.0);
  sensor.setTarget(surface, 0.0, 0.0, 0.0);  // tooth 1, at the eccentric side
  EXPECT_NEAR(sensor.clearance(100e-6), 80e-6, 1e-9);
  sensor.setTarget(surface, -0.5 * PI, 0.0, 0.0);  // tooth 2
  EXPECT_NEAR(sensor.clearance(100e-6), 130e-6, 1e-6);
  // Ten teeth: between two of them the sensor's centre faces the floor, its housing the edges.
  StationTraits round;
  round.housing = 10e-3;
  round.rake_flank = round.relief_flank = 0.1;
  ToolGeometry straight = mill(10, 19e-3);
  straight.helix = 0.0;
  const ToolSurface many(round, straight, 1e-3);
  GapSensor between(round, station, 0.0);
  between.setTarget(many, units::radFromDeg(18.0), 0.0, 0.0);
  const double edge = 9.5e-3 * (1.0 - std::cos(units::radFromDeg(18.0)));
  EXPECT_NEAR(between.clearance(0.0), edge, 60e-6);  // spots of 0.3 mm on a steep flank
  EXPECT_LT(between.voltage(250e-6), -7.0);
  // Up to the upper end of the housing the helix shifts an edge by 17.4 of these 18 degrees.
  between.setTarget(ToolSurface(round, mill(10, 19e-3), 1e-3), units::radFromDeg(18.0), 0.0, 0.0);
  EXPECT_NEAR(between.clearance(0.0), 0.0, 30e-6);
}

TEST(Solenoid, HalfSineBounceAndCurrent) {
  StationTraits traits;
  traits.bounce_chance = 1.0;
  traits.bounce_share = 0.4;
  traits.bounce_delay = 3e-3;
  traits.pulse_scatter = 0.05;
  std::mt19937_64 random(3);
  Solenoid plain(StationTraits(), stationModel(), 0.0);
  plain.fire(0.0, 0.03, random);
  EXPECT_NEAR(plain.force(0.0302), 200.0, 1e-6);
  EXPECT_NEAR(plain.force(0.0301), 200.0 * std::sin(0.25 * PI), 1e-6);
  EXPECT_TRUE(plain.over(0.0305));
  Solenoid bouncing(traits, stationModel(), 0.05);
  std::vector<double> first, second, impulse;
  for (int k = 0; k < 200; ++k) {
    bouncing.fire(0.0, 0.03, random);
    double one = 0.0, two = 0.0, sum = 0.0;
    for (double t = 0.0299; t < 0.04; t += 2e-6) {
      const double f = bouncing.force(t);
      sum += 2e-6 * f;
      (t < 0.0312 ? one : two) = std::max(t < 0.0312 ? one : two, f);
    }
    first.push_back(one);
    second.push_back(two);
    impulse.push_back(sum);
  }
  const auto mean = [](const std::vector<double>& v) {
    return std::accumulate(v.begin(), v.end(), 0.0) / static_cast<double>(v.size());
  };
  EXPECT_NEAR(mean(first), 200.0, 3.0);  // 4 sigma of 200: 2.8 N
  EXPECT_NEAR(mean(second), 80.0, 5.0);
  EXPECT_GT(*std::max_element(first.begin(), first.end()), 215.0);
  // The current reaches its final value at the contact, then decays.
  EXPECT_NEAR(plain.current(0.003), 1.0 - std::exp(-1.0), 1e-9);
  EXPECT_NEAR(plain.current(0.033), (1.0 - std::exp(-10.0)) * std::exp(-1.0), 1e-9);
}

TEST(StationTraits, ErrorNamesTheInconsistentKey) {
  StationTraits traits;
  traits.spindle_slope.pop_back();
  try {
    traits.validate();
    FAIL();
  } catch (const Error& e) {
    EXPECT_NE(std::string(e.what()).find("spindle_slope"), std::string::npos) << e.what();
  }
}

}  // namespace
}  // namespace smartmill::sim
