#include "node/parameters.h"

#include "smartmill_core/testing/shipped_parameters.h"
#include "smartmill_core/testing/temporary_folder.h"

namespace smartmill::kalman {
namespace {

TEST(Parameters, TheShippedFileIsTheTable) {
  expectShipped<NodeParameters>("../launch/config/kalman.yaml", "smartmill_kalman kalman_node");
  EXPECT_NO_THROW(NodeParameters().validate());
}

// The flag of earlier versions.
TEST(Parameters, ABooleanOfTrackSpeedIsRefusedWithTheNewWords) {
  const TemporaryFolder folder;
  for (const std::string flag : {"true", "false", "on", "off"}) {
    const std::string file = folder.write("p.yaml", "track_speed: " + flag + "\n");
    const std::string error = errorOf([&] { ParameterReader::fromFile(file).readAll<NodeParameters>(); });
    EXPECT_NE(error.find("track_speed: '"), std::string::npos) << error;
    EXPECT_NE(error.find("is a boolean, expected a string: auto | always | never"), std::string::npos)
        << error;
    EXPECT_EQ(error.find('\n'), std::string::npos);
  }
}

}  // namespace
}  // namespace smartmill::kalman
