#include "smartmill_stability/coupling/beam.h"

#include <cmath>

#include <gtest/gtest.h>

#include "smartmill_core/units.h"

namespace smartmill::stability {
namespace {

using units::PI;
using units::TWO_PI;

/// Steel, slightly damped so that resonances are finite.
BeamSegment bar(double length, double diameter) {
  return {length, diameter, 0.0, {210e9, 7850.0, 0.29, 1e-4}, {}};
}

/// [Hz] Natural frequency n of a Euler-Bernoulli beam: (beta L)^2 / (2 pi L^2) sqrt(E I / (rho A)).
double eulerBernoulli(double beta_length, const BeamSegment& s) {
  return std::pow(beta_length, 2) / (TWO_PI * s.length * s.length) *
         std::sqrt(s.material.young * s.diameter * s.diameter / (16.0 * s.material.density));
}

template <class Magnitude>
double peak(double low, double high, const Magnitude& magnitude) {
  double best = low, largest = 0.0;
  for (double f = low; f < high; f *= 1.0002) {
    const double size = magnitude(f);
    if (size > largest) {
      largest = size;
      best = f;
    }
  }
  return best;
}

TEST(Beam, SlenderFreeBeamHasTheFrequenciesOfEulerBernoulli) {
  const BeamSegment slender = bar(1.0, 0.01);  // shear and rotatory inertia: 2e-4 of the first frequency
  for (const double beta : {4.730041, 7.853205, 10.995608}) {
    const double expected = eulerBernoulli(beta, slender);
    const double found = peak(0.9 * expected, 1.1 * expected,
                              [&](double f) { return std::abs(beamReceptances(slender, f).r11(0, 0)); });
    EXPECT_NEAR(found, expected, 2e-3 * expected);
  }
}

TEST(Beam, ClampedSlenderBeamHasTheFrequenciesOfEulerBernoulli) {
  const BeamSegment slender = bar(0.5, 0.006);
  for (const double beta : {1.875104, 4.694091}) {
    const double expected = eulerBernoulli(beta, slender);
    const double found = peak(0.9 * expected, 1.1 * expected, [&](double f) {
      return std::abs(joined(beamReceptances(slender, f), Receptance::Zero(), Receptance::Zero())(0, 0));
    });
    EXPECT_NEAR(found, expected, 2e-3 * expected);
  }
}

TEST(Beam, ClampedBeamDeflectsByTimoshenkosStaticFormula) {
  const BeamSegment thick = bar(0.05, 0.02);
  const double i = PI * std::pow(0.02, 4) / 64.0, a = 0.25 * PI * 0.02 * 0.02, nu = 0.29;
  const double k = 6.0 * (1.0 + nu) / (7.0 + 6.0 * nu), g = 210e9 / (2.0 * (1.0 + nu));
  const Receptance tip = joined(beamReceptances(thick, 5.0), Receptance::Zero(), Receptance::Zero());
  EXPECT_NEAR(tip(0, 0).real() / (std::pow(0.05, 3) / (3.0 * 210e9 * i) + 0.05 / (k * g * a)), 1.0, 1e-3);
  // Positive rotation is dw/dx, x towards the clamped end.
  EXPECT_NEAR(tip(1, 0).real() / (-0.05 * 0.05 / (2.0 * 210e9 * i)), 1.0, 1e-3);
  EXPECT_NEAR(tip(1, 1).real() / (0.05 / (210e9 * i)), 1.0, 1e-3);
}

TEST(Beam, LowFrequenciesAreThoseOfARigidBody) {
  const BeamSegment b = bar(0.2, 0.02);
  const double mass = 7850.0 * 0.25 * PI * 0.02 * 0.02 * 0.2;
  const double inertia = mass * (0.2 * 0.2 / 12.0 + 0.02 * 0.02 / 16.0), w2 = std::pow(TWO_PI * 20.0, 2);
  const EndReceptances r = beamReceptances(b, 20.0);
  EXPECT_NEAR(r.r11(0, 0).real() * -w2, 1.0 / mass + 0.1 * 0.1 / inertia, 1e-3 * 4.0 / mass);
  EXPECT_NEAR(r.r12(0, 0).real() * -w2, 1.0 / mass - 0.1 * 0.1 / inertia, 1e-3 * 4.0 / mass);
}

TEST(Beam, ReceptancesAreReciprocal) {
  const EndReceptances r = beamReceptances(
      std::vector<BeamSegment>{
          bar(0.03, 0.008), bar(0.05, 0.012), {0.06, 0.04, 0.012, {210e9, 7850.0, 0.29, 0.01}, {}}},
      1234.0);
  for (int i = 0; i < 2; ++i) {
    for (int j = 0; j < 2; ++j) {
      EXPECT_LT(std::abs(r.r11(i, j) - r.r11(j, i)), 1e-9 * r.r11.norm());
      EXPECT_LT(std::abs(r.r12(i, j) - r.r21(j, i)), 1e-9 * r.r12.norm());
    }
  }
}

TEST(Beam, CutInTwoAndJoinedIsTheUniformBeam) {
  for (const double f : {30.0, 400.0, 1500.0, 6000.0}) {
    const EndReceptances whole = beamReceptances(bar(0.25, 0.02), f);
    const EndReceptances two = beamReceptances(std::vector<BeamSegment>{bar(0.07, 0.02), bar(0.18, 0.02)}, f);
    EXPECT_LT((whole.r11 - two.r11).norm(), 1e-8 * whole.r11.norm()) << f;
    EXPECT_LT((whole.r12 - two.r12).norm(), 1e-8 * whole.r12.norm()) << f;
    EXPECT_LT((whole.r22 - two.r22).norm(), 1e-8 * whole.r22.norm()) << f;
  }
}

TEST(Beam, CoreOfTheSameMaterialIsASolidBar) {
  BeamSegment filled = bar(0.1, 0.04);
  filled.bore = 0.012;
  filled.core = filled.material;
  const EndReceptances a = beamReceptances(filled, 900.0), b = beamReceptances(bar(0.1, 0.04), 900.0);
  EXPECT_LT((a.r11 - b.r11).norm(), 1e-9 * b.r11.norm());
}

TEST(Beam, ASoftJointLeavesTheToolFree) {
  const BeamSegment b = bar(0.1, 0.012);
  Receptance soft = Receptance::Identity() * 1e6;
  const EndReceptances free = beamReceptances(b, 500.0);
  EXPECT_LT((joined(free, Receptance::Zero(), soft) - free.r11).norm(), 1e-6 * free.r11.norm());
}

TEST(Beam, RefusesAnUnknownMaterial) {
  EXPECT_THROW(beamMaterial("wood"), std::exception);
  EXPECT_THROW(beamReceptances(std::vector<BeamSegment>{}, 100.0), std::exception);
}

}  // namespace
}  // namespace smartmill::stability
