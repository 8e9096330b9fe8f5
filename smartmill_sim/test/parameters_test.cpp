#include "../src/node/parameters.h"
#include "../src/node/fault_parameters.h"
#include "../src/node/lathe_parameters.h"

#include "smartmill_core/testing/shipped_parameters.h"

namespace smartmill::sim {
namespace {

TEST(Parameters, TheShippedFileIsTheTable) {
  expectShipped<NodeParameters>("../launch/config/sim.yaml", "smartmill_sim sim_node");
  EXPECT_NO_THROW(NodeParameters().validate());
  expectShipped<LatheParameters>("../launch/config/lathe.yaml", "smartmill_sim lathe_node");
  EXPECT_NO_THROW(LatheParameters().validate());
  expectShipped<FaultParameters>("../launch/config/faults.yaml", "smartmill_sim fault_node");
  EXPECT_NO_THROW(FaultParameters().validate());
}

}  // namespace
}  // namespace smartmill::sim
