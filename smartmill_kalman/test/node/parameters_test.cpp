#include "node/parameters.h"

#include "smartmill_core/testing/shipped_parameters.h"

namespace smartmill::kalman {
namespace {

TEST(Parameters, TheShippedFileIsTheTable) {
  expectShipped<NodeParameters>("../launch/config/kalman.yaml", "smartmill_kalman kalman_node");
  EXPECT_NO_THROW(NodeParameters().validate());
}

}  // namespace
}  // namespace smartmill::kalman
