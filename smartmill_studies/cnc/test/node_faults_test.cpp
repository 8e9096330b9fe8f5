// The quickest of the faults with real processes; node_faults.py runs all of them.
#include <gtest/gtest.h>

#include <cstdlib>
#include <string>

namespace {

TEST(NodeFaults, AControllerKilledOrHangingAndASixthSessionAreToldAndNothingMoves) {
  // of_the_server, of_the_sessions
  EXPECT_EQ(std::system("/usr/bin/python3 '" SCRIPT "' --only of_the_se"), 0);
}

}  // namespace
