#include "node/parameters.h"

#include <fstream>
#include <sstream>

#include <gtest/gtest.h>

namespace smartmill::panel {
namespace {

TEST(Parameters, ShippedFileMatchesTheTable) {
  std::ifstream in(LAUNCH_CONFIG_FOLDER "/panel.yaml");
  std::stringstream shipped;
  shipped << in.rdbuf();
  PanelParameters parameters;
  EXPECT_EQ(tableOf(parameters).yaml(), shipped.str());
  EXPECT_NO_THROW(parameters.validate());
}

}  // namespace
}  // namespace smartmill::panel
