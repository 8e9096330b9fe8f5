#include "node/monitor_parameters.h"

#include "smartmill_core/testing/shipped_parameters.h"

namespace smartmill::discrepancy {
namespace {

TEST(Parameters, ShippedFileMatchesTheTable) {
  expectShipped<MonitorParameters>("../launch/config/monitor.yaml", "smartmill_discrepancy monitor");
  EXPECT_NO_THROW(MonitorParameters().validate());
}

}  // namespace
}  // namespace smartmill::discrepancy
