#include "node/hammer_server.h"
#include "smartmill_ros/node_main.h"

int main(int argc, char** argv) {
  return smartmill::runNode<smartmill::hammer::HammerServer>(argc, argv, "hammer");
}
