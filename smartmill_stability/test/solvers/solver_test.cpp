#include "smartmill_stability/solvers/solver.h"

#include <cmath>

#include <gtest/gtest.h>

#include "smartmill_core/error.h"
#include "smartmill_core/testing/shared_data.h"
#include "smartmill_stability/solvers/delayed_system.h"
#include "smartmill_stability_testing/oracles.h"

namespace smartmill::stability {
namespace {

using units::radPerSecFromRpm;

constexpr double MAX_DEPTH = 10e-3;
/// [mm] Rounding of the tables.
constexpr double PRINTED = 0.5e-5;

struct Row {
  double rpm, limit_mm;
  Kind kind = Kind::hopf;
};

void check(const StabilitySolver& solver, const std::vector<Row>& rows, double share) {
  for (const Row& row : rows) {
    const Limit limit = solver.limit(radPerSecFromRpm(row.rpm), MAX_DEPTH);
    if (std::isinf(row.limit_mm)) {
      EXPECT_TRUE(std::isinf(limit.depth)) << row.rpm << " rpm: " << limit.depth;
      continue;
    }
    EXPECT_NEAR(limit.depth * 1e3, row.limit_mm, share * row.limit_mm + PRINTED) << row.rpm << " rpm";
    EXPECT_EQ(limit.kind, row.kind) << row.rpm << " rpm";
  }
}

const double INF = std::numeric_limits<double>::infinity();
const std::vector<Row> SLOT{{5000, 0.40863},  {6000, 0.35322},
                            {7000, 1.15199},  {8000, 0.67639},
                            {10000, 0.32238}, {12000, 2.14931, Kind::flip},
                            {14000, 2.14001}, {15000, 0.38659},
                            {18000, 0.68954}, {20000, 1.41751, Kind::flip}};
const std::vector<Row> FINISHING{{5000, 2.20692},
                                 {6000, 3.07133},
                                 {7000, 4.84688, Kind::flip},
                                 {8000, 2.16316},
                                 {10000, 4.09071, Kind::flip},
                                 {12000, 1.68052},
                                 {14000, INF},
                                 {15000, 8.21248, Kind::flip},
                                 {18000, 1.29514, Kind::flip},
                                 {20000, 2.29868}};
const std::vector<Row> SLOT_XY{{6000, 0.0483482}, {10000, 0.0714108}, {15000, 0.1144476}, {20000, 0.0632216}};
const std::vector<Row> FINISHING_XY{
    {6000, 1.536267}, {10000, 1.486950}, {15000, 1.651214}, {20000, 3.250386, Kind::flip}};

TEST(Collocation, oneDegreeOfFreedomAgreesWithTheTable) {
  check(*makeSolver(Method::collocation, benchmarkSystem(1.0, true, false)), SLOT, 1e-6);
  check(*makeSolver(Method::collocation, benchmarkSystem(0.05, true, false)), FINISHING, 1e-6);
}

TEST(Collocation, twoDegreesOfFreedomAgreeWithTheTable) {
  check(*makeSolver(Method::collocation, benchmarkSystem(1.0, true, true)), SLOT_XY, 1e-6);
  check(*makeSolver(Method::collocation, benchmarkSystem(0.05, true, true)), FINISHING_XY, 1e-6);
}

// Every tabulated limit; the table was computed by a scan in steps of 0.05 mm.
TEST(Collocation, everyTabulatedImmersion) {
  int checked = 0;
  SMARTMILL_SHARED_DATA(file, "oracles/insperger_1dof_first_limit.csv");
  for (const OracleRow& row : oracleRows(file)) {
    const auto solver = makeSolver(Method::collocation, benchmarkSystem(row.immersion, row.down, false));
    const Limit limit = solver->limit(radPerSecFromRpm(row.rpm), MAX_DEPTH);
    if (std::isinf(row.limit_mm)) {
      EXPECT_TRUE(std::isinf(limit.depth)) << row.immersion << row.down << row.rpm;
    } else {
      EXPECT_NEAR(limit.depth * 1e3 / row.limit_mm, 1.0, 2e-5) << row.immersion << row.down << row.rpm;
    }
    ++checked;
  }
  EXPECT_EQ(checked, 63);
}

// The zero-order solution gives 6.85 mm here (zero_order_test).
TEST(MultiFrequency, findsTheFlipThatZeroOrderMisses) {
  SolverOptions options;
  options.harmonics = 20;
  const auto solver = makeSolver(Method::multi_frequency, benchmarkSystem(0.05, true, true), options);
  const Limit limit = solver->limit(radPerSecFromRpm(20000.0), MAX_DEPTH);
  EXPECT_NEAR(limit.depth * 1e3, 3.250386, 1e-3 * 3.25);
  EXPECT_EQ(limit.kind, Kind::flip);
  EXPECT_NEAR(limit.frequency, 1000.0, 1e-6);  // odd multiple of half the tooth passing frequency, 333 Hz
  const auto mean = makeSolver(Method::zero_order, benchmarkSystem(0.05, true, true));
  EXPECT_NEAR(mean->limit(radPerSecFromRpm(20000.0), MAX_DEPTH).depth * 1e3, 6.850, 6e-3 * 6.85);
}

TEST(SemiDiscretization, agreesWithTheTable) {
  SolverOptions options;
  options.steps = 400;
  options.order = 2;
  check(*makeSolver(Method::semi_discretization, benchmarkSystem(1.0, true, false), options),
        {{10000, 0.32238}, {12000, 2.14931, Kind::flip}, {20000, 1.41751, Kind::flip}}, 1e-3);
  check(*makeSolver(Method::semi_discretization, benchmarkSystem(0.05, true, true), options),
        {{20000, 3.250386, Kind::flip}}, 1e-3);
}

DelayedSystem mathieu() {
  DelayedSystem system;
  const double w = std::sqrt(3.0);
  system.modes = {{w / units::TWO_PI, 0.1 / (2.0 * w), {{1.0, 0.0}}, {{1.0, 0.0}}}};
  system.period = units::TWO_PI;
  system.delays = {units::TWO_PI};
  system.stiffness = 2.0;
  system.rate = 1.0;
  system.feedback = [](double t, double, Feedback& f) {
    f.now.setZero();
    f.velocity.setZero();
    f.delayed.assign(1, Eigen::Matrix2d::Zero());
    f.now(0, 0) = -2.0 * std::cos(t);
    f.delayed[0](0, 0) = -0.15;
  };
  return system;
}

// Delayed Mathieu equation, delta 3, eps 2, damping 0.1, delayed gain -0.15: 0.5120523.
TEST(DelayedMathieu, spectralRadius) {
  EXPECT_NEAR(collocationMultiplier(mathieu(), 12).radius(), 0.5120523, 1e-6);
  // Published: .51170, .51196, .51203 at 80, 160, 320 steps.
  EXPECT_NEAR(semiDiscretizationMultiplier(mathieu(), 320, 0).radius(), 0.51203, 1e-5);
  EXPECT_NEAR(semiDiscretizationMultiplier(mathieu(), 5120, 1).radius(), 0.5120523, 1e-6);
}

/// Smallest and largest order of convergence between successive doublings of the resolution.
std::pair<double, double> slopes(const std::function<double(int)>& value, double exact, int first,
                                 int count) {
  double least = 1e9, most = -1e9, before = std::abs(value(first) - exact);
  for (int i = 1; i < count; ++i) {
    const double error = std::abs(value(first << i) - exact);
    const double slope = std::log2(before / error);
    least = std::min(least, slope);
    most = std::max(most, slope);
    before = error;
  }
  return {least, most};
}

// The mean of the feedback over a step limits the order to two for every interpolation order.
TEST(Convergence, semiDiscretizationIsOfSecondOrder) {
  const double exact = collocationMultiplier(mathieu(), 24).radius();
  for (const int order : {0, 1, 2}) {
    const auto [least, most] =
        slopes([&](int steps) { return semiDiscretizationMultiplier(mathieu(), steps, order).radius(); },
               exact, 80, 5);
    EXPECT_NEAR(least, 2.0, 0.1) << order;
    EXPECT_NEAR(most, 2.0, 0.15) << order;
  }
}

// Jumps at entry and exit: Fourier coefficients of the feedback decrease as 1/k, receptances as 1/k^2.
TEST(Convergence, multiFrequencyIsOfThirdOrderInTheHarmonics) {
  const RegenerativeSystem system = benchmarkSystem(0.05, true, false);
  const double speed = radPerSecFromRpm(20000.0);
  const double exact = makeSolver(Method::collocation, system)->limit(speed, MAX_DEPTH).depth;
  const auto [least, most] = slopes(
      [&](int harmonics) {
        SolverOptions options;
        options.harmonics = harmonics;
        return makeSolver(Method::multi_frequency, system, options)->limit(speed, MAX_DEPTH).depth;
      },
      exact, 5, 3);
  EXPECT_GT(least, 2.2);
  EXPECT_LT(most, 3.2);
}

// Two more nodes reduce the error at least tenfold, down to rounding.
TEST(Convergence, collocationIsSpectral) {
  const RegenerativeSystem system = benchmarkSystem(1.0, true, false);
  const auto depth = [&](int nodes) {
    SolverOptions options;
    options.nodes = nodes;
    options.tolerance = 1e-12;
    return makeSolver(Method::collocation, system, options)->limit(radPerSecFromRpm(5000.0), MAX_DEPTH).depth;
  };
  const double exact = depth(24);
  double before = std::abs(depth(6) - exact);
  for (const int nodes : {8, 10, 12}) {
    const double error = std::abs(depth(nodes) - exact);
    EXPECT_LT(error, before / 10.0) << nodes;
    before = error;
  }
  EXPECT_LT(before, 1e-6 * exact);
}

TEST(Convergence, theErrorEstimateCoversTheError) {
  const RegenerativeSystem system = benchmarkSystem(1.0, true, false);
  for (const double rpm : {5000.0, 9300.0, 15000.0}) {
    SolverOptions coarse, fine;
    coarse.nodes = 8;
    coarse.estimate_error = true;
    fine.nodes = 24;
    const Limit rough =
        makeSolver(Method::collocation, system, coarse)->limit(radPerSecFromRpm(rpm), MAX_DEPTH);
    const double exact =
        makeSolver(Method::collocation, system, fine)->limit(radPerSecFromRpm(rpm), MAX_DEPTH).depth;
    const double error = std::abs(rough.depth - exact);
    EXPECT_LT(error, 1.5 * rough.error + 2e-6 * exact) << rpm;
    EXPECT_GT(2.0 * error + 2e-6 * exact, rough.error) << rpm;
  }
}

RegenerativeSystem turning(double zeta) {
  RegenerativeSystem system;
  system.cut = Cut::turning;
  system.entry = 0.5 * units::PI;  // edge at +x: radial force and chip along x
  system.kr = 1e9;
  system.kt = 0.0;
  system.modes = systemModes(ModalModel{{{100.0, zeta, 1e-8}}, 0.0}, 0);
  return system;
}

// Merritt's minimum 2 k zeta (1 + zeta) / k_f at the bottom of a lobe, with chatter frequency w_c = w_n
// sqrt(1 + 2 zeta).
TEST(Turning, minimumOfMerrittFromTheMultipliers) {
  const double zeta = 0.05, minimum = 2.0 * 1e8 * zeta * (1.0 + zeta) / 1e9;
  SolverOptions options;
  options.tolerance = 1e-10;
  const auto solver = makeSolver(Method::collocation, turning(zeta), options);
  // At the minimum G(i w_c) = (-1 - i s) / (2 b kf): 1 - exp(-i w T) = -1 / (b kf G).
  const double w = units::TWO_PI * 100.0 * std::sqrt(1.0 + 2.0 * zeta);
  const auto g = receptance(turning(zeta).modes, w / units::TWO_PI)[0];
  double phase = -std::arg(1.0 + 1.0 / (minimum * 1e9 * g));
  while (phase < 0.0) phase += units::TWO_PI;
  for (const int lobe : {0, 1, 3}) {
    const double speed = units::TWO_PI * w / (phase + units::TWO_PI * lobe);
    const Limit limit = solver->limit(speed, 0.1);
    EXPECT_NEAR(limit.depth / minimum, 1.0, 1e-6) << lobe;
    EXPECT_NEAR(limit.frequency * units::TWO_PI / w, 1.0, 1e-5) << lobe;
    // It is a minimum.
    EXPECT_GT(solver->limit(1.01 * speed, 0.1).depth, minimum);
    EXPECT_GT(solver->limit(0.99 * speed, 0.1).depth, minimum);
  }
}

// Without overlap there is no regeneration and one mode is stable; two modes with inclined axes are unstable
// by mode coupling.
TEST(Turning, modeCouplingWithoutRegeneration) {
  RegenerativeSystem system = turning(0.02);
  system.overlap = 0.0;
  EXPECT_TRUE(std::isinf(makeSolver(Method::collocation, system)->limit(100.0, 0.1).depth));
  // Two modes with perpendicular axes, the cutting force between them: with growing depth their frequencies
  // coincide and one of them becomes unstable (flutter).
  const auto inclined = [](double frequency, double angle) {
    SystemMode mode{
        frequency, 0.01, {{std::sin(angle), std::cos(angle)}}, {{std::sin(angle), std::cos(angle)}}};
    return mode;
  };
  system.modes = {inclined(120.0, units::radFromDeg(50.0)), inclined(100.0, units::radFromDeg(140.0))};
  system.kt = 1e9;
  system.kr = 0.5e9;
  const Limit limit = makeSolver(Method::collocation, system)->limit(100.0, 1.0);
  ASSERT_TRUE(std::isfinite(limit.depth));
  // Independent stability criterion of the modes with constant feedback; positive: unstable.
  const auto growth = [&](double depth) {
    Feedback f;
    delayedSystem(system, 100.0, depth).feedback(0.0, 0.0, f);
    // Coefficients a_0 .. a_3 of the quartic det(diag(l^2 + 2 z w l + w^2) - I^T F O) = 0.
    double c[2][2];
    for (int i = 0; i < 2; ++i)
      for (int j = 0; j < 2; ++j) {
        const auto& in = system.modes[static_cast<std::size_t>(i)].input;
        const auto& out = system.modes[static_cast<std::size_t>(j)].output;
        c[i][j] = 0.0;
        for (int p = 0; p < 2; ++p)
          for (int q = 0; q < 2; ++q)
            c[i][j] += in[static_cast<std::size_t>(p)] * f.now(p, q) * out[static_cast<std::size_t>(q)];
      }
    const double w1 = units::TWO_PI * 120.0, w2 = units::TWO_PI * 100.0, d1 = 0.02 * w1, d2 = 0.02 * w2;
    const double k1 = w1 * w1 - c[0][0], k2 = w2 * w2 - c[1][1], cc = c[0][1] * c[1][0];
    const double a3 = d1 + d2, a2 = k1 + k2 + d1 * d2, a1 = d1 * k2 + d2 * k1, a0 = k1 * k2 - cc;
    // Routh: stable for a1 a2 a3 - a1^2 - a3^2 a0 > 0 (and a0 > 0).
    return -(a1 * a2 * a3 - a1 * a1 - a3 * a3 * a0);
  };
  EXPECT_LT(growth(limit.depth * 0.9999), 0.0);
  EXPECT_GT(growth(limit.depth * 1.0001), 0.0);
}

TEST(Solvers, refuseInvalidInput) {
  RegenerativeSystem system = benchmarkSystem(1.0, true, false);
  EXPECT_THROW(makeSolver(Method::collocation, system)->limit(-1.0, 1e-3), Error);
  EXPECT_THROW(makeSolver(Method::collocation, system)->limit(1000.0, 0.0), Error);
  SolverOptions options;
  options.nodes = 2;
  EXPECT_THROW(makeSolver(Method::collocation, system, options), Error);
  system.teeth = 0;
  EXPECT_THROW(makeSolver(Method::collocation, system), Error);
  system = benchmarkSystem(1.0, true, false);
  system.modes.clear();
  EXPECT_THROW(makeSolver(Method::collocation, system), Error);
  EXPECT_THROW(makeFloquetSolver(Method::zero_order, benchmarkSystem(1.0, true, false)), Error);
  EXPECT_THROW(methodOf("guess"), Error);
}

}  // namespace
}  // namespace smartmill::stability
