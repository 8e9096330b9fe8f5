#include "node/control_node.h"
#include "smartmill_ros/node_main.h"

int main(int argc, char** argv) {
  return smartmill::runNode<smartmill::stability::ControlNode>(argc, argv, "chatter_control");
}
