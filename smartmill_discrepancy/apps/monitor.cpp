#include "node/monitor_node.h"
#include "smartmill_ros/node_main.h"

int main(int argc, char** argv) {
  return smartmill::runNode<smartmill::discrepancy::MonitorNode>(argc, argv, "monitor");
}
