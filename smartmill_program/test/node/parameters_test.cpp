#include "node/parameters.h"

#include "node/tool_parameters.h"
#include "smartmill_core/testing/shipped_parameters.h"

namespace smartmill::program {
namespace {

TEST(Parameters, ShippedFileMatchesTheTable) {
  expectShipped<NodeParameters>("../launch/config/program.yaml", "smartmill_program program_node");
  EXPECT_NO_THROW(NodeParameters().validate());
}

TEST(Parameters, ShippedFileOfTheToolNodeMatchesTheTable) {
  expectShipped<ToolNodeParameters>("../launch/config/tool.yaml", "smartmill_program tool_node");
  EXPECT_NO_THROW(ToolNodeParameters().validate());
}

}  // namespace
}  // namespace smartmill::program
