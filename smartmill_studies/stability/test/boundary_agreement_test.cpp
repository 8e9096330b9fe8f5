#include "stability/boundary_agreement.h"

#include <gtest/gtest.h>

#include "smartmill_core/error.h"
#include "smartmill_core/units.h"

namespace smartmill::stability {
namespace {

BoundaryOptions options(double entry_deg, double low_rpm, double high_rpm) {
  BoundaryOptions o;
  o.speed_low = units::radPerSecFromRpm(low_rpm);
  o.speed_high = units::radPerSecFromRpm(high_rpm);
  o.max_depth = 20e-3;
  o.entry_deg = entry_deg;
  o.points = 4;
  o.seed = 7;
  return o;
}

// The study counts 60 limits of each.
TEST(BoundaryAgreement, limitsAlongAThinWall) {
  const MachineModel wall = readMachineModel(WALL_FILE);
  for (const SidedLimit& p : agreementAtBoundary(wall, options(120.0, 4000.0, 12000.0)))
    EXPECT_TRUE(p.agrees()) << p.position << " " << units::rpmFromRadPerSec(p.speed);
}

TEST(BoundaryAgreement, limitsOfAVariedSpeedInASlot) {
  BoundaryOptions o = options(0.0, 3000.0, 9000.0);
  o.variation = SpeedVariation{0.2, 0.125};
  for (const SidedLimit& p : agreementAtBoundary(readMachineModel(MODEL_FILE), o))
    EXPECT_TRUE(p.agrees()) << units::rpmFromRadPerSec(p.speed);
}

TEST(BoundaryAgreement, refusesWhatCannotBe) {
  BoundaryOptions o = options(0.0, 3000.0, 9000.0);
  o.variation = SpeedVariation{0.2, 0.1234567};
  EXPECT_THROW(agreementAtBoundary(readMachineModel(MODEL_FILE), o), Error);
  o = options(0.0, 3000.0, 9000.0);
  o.points = 0;
  EXPECT_THROW(agreementAtBoundary(readMachineModel(MODEL_FILE), o), Error);
}

}  // namespace
}  // namespace smartmill::stability
