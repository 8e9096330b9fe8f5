#include "../../src/node/parameters.h"

#include "smartmill_core/testing/shipped_parameters.h"

namespace smartmill::hammer {
namespace {

TEST(Parameters, TheShippedFileIsTheTable) {
  expectShipped<NodeParameters>("../launch/config/hammer.yaml", "smartmill_hammer hammer_node");
  EXPECT_NO_THROW(NodeParameters().validate());
}

}  // namespace
}  // namespace smartmill::hammer
