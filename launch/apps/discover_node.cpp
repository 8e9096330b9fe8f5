#include "session/discovery.h"
#include "smartmill_ros/run_node.h"

int main(int argc, char** argv) {
  return smartmill::runNode<smartmill::session::Discovery>(argc, argv, "discover");
}
