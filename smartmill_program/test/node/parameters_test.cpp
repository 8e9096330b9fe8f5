#include "node/parameters.h"

#include "smartmill_core/testing/shipped_parameters.h"

namespace smartmill::program {
namespace {

TEST(Parameters, ShippedFileMatchesTheTable) {
  expectShipped<NodeParameters>("../launch/config/program.yaml", "smartmill_program program_node");
  EXPECT_NO_THROW(NodeParameters().validate());
}

}  // namespace
}  // namespace smartmill::program
