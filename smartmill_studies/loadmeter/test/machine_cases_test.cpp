#include <algorithm>
#include <cmath>
#include <numeric>

#include <gtest/gtest.h>

#include "loadmeter/machine_cases.h"
#include "smartmill_core/cutting/mechanistic.h"
#include "smartmill_core/testing/coverage.h"
#include "smartmill_core/units.h"
#include "smartmill_loadmeter/identification/runout_torque.h"

namespace smartmill::loadmeter {
namespace {

TEST(Scene, torqueWithoutRunoutIsTheClosedForm) {
  const ToolGeometry tool{3, 0.016, 0.5, {}};
  const CuttingCoefficients k{900e6, 0, 0, 20e3, 0, 0};
  const Engagement e{0.3, 2.5, 0.003, 8e-5};
  const std::vector<double> torque = torqueOverARevolution(tool, e, k, 0.0, 0.0, 720);
  const double mean = std::accumulate(torque.begin(), torque.end(), 0.0) / 720.0;
  EXPECT_NEAR(mean, MechanisticForce(tool, k, e).mean().torque, 2e-3 * mean);  // angle steps
  EXPECT_NEAR(torque[100], MechanisticForce(tool, k, e).at(100 * units::TWO_PI / 720).torque, 0.05 * mean);
}

TEST(Scene, runoutMovesMaterialFromToothToToothWhileAllCut) {
  const ToolGeometry tool{4, 0.016, 0.0, {}};
  const CuttingCoefficients k{900e6, 0, 0, 0, 0, 0};
  const Engagement e{0.8, 2.3, 0.003, 1e-4};
  const auto straight = torqueOverARevolution(tool, e, k, 0.0, 0.0, 720);
  const auto offset = torqueOverARevolution(tool, e, k, 8e-6, 1.0, 720);
  EXPECT_NEAR(std::accumulate(straight.begin(), straight.end(), 0.0),
              std::accumulate(offset.begin(), offset.end(), 0.0), 1e-3 * 720);
  EXPECT_NE(straight[200], offset[200]);
}

// Comparison with summed slices, including teeth that miss a segment of their arc.
TEST(RunoutTorque, isTheTorqueOfTheSlices) {
  for (const double offset : {0.0, 8e-6, 40e-6, 90e-6}) {
    for (const double helix : {0.0, 0.5}) {
      ToolGeometry tool{4, 0.016, helix, {}};
      if (offset > 50e-6) tool.pitch = {1.4, 1.7, 1.5, units::TWO_PI - 4.6};
      const Engagement e{0.2, 2.9, 0.002, 6e-5};
      const double angle = 4.57;
      const RunoutTorque closed(tool, e, offset * std::cos(angle), offset * std::sin(angle));
      constexpr std::size_t STEPS = 1440;
      for (std::size_t u = 0; u < 2; ++u) {
        const CuttingCoefficients k =
            u == 0 ? CuttingCoefficients{1e9, 0, 0, 0, 0, 0} : CuttingCoefficients{0, 0, 0, 1e4, 0, 0};
        const double unit = u == 0 ? 1e9 : 1e4;
        const auto slices = torqueOverARevolution(tool, e, k, offset, angle, STEPS);
        const double mean = std::accumulate(slices.begin(), slices.end(), 0.0) / STEPS;
        EXPECT_NEAR(unit * closed.mean()[u], mean, 2e-3 * mean) << offset << " " << helix;
        double error2 = 0.0;
        for (std::size_t i = 0; i < STEPS; ++i) {
          const double at = unit * closed.at(units::TWO_PI * static_cast<double>(i) / STEPS)[u];
          error2 += (at - slices[i]) * (at - slices[i]) / STEPS;
        }
        // 24 slices give a step of the edge torque at each entry and exit.
        EXPECT_LT(std::sqrt(error2), 0.03 * mean) << offset << " " << helix;
      }
    }
  }
}

// The full study of 200 cases is the program loadmeter_cases.
TEST(Cases, ktcIsWithinThreeAndSixPercentAndHonest) {
  const Faults faults;
  std::vector<double> errors;
  Coverage ktc;
  const int count = Coverage::FEW;
  for (int i = 0; i < count; ++i) {
    const CaseErrors e = judge(drawCase(static_cast<unsigned>(1000 + i), faults), faults);
    errors.push_back(std::abs(e.ktc));
    ktc.add(e.z_ktc, 1.0);
  }
  std::sort(errors.begin(), errors.end());
  EXPECT_LT(errors[count / 2], 0.03);
  EXPECT_LT(errors[static_cast<std::size_t>(0.95 * count)], 0.06);
  EXPECT_TRUE(ktc.isCalibrated(0.0, Coverage::FACTOR_OF_FEW));
}

}  // namespace
}  // namespace smartmill::loadmeter
