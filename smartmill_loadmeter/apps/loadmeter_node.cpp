#include "node/node.h"
#include "smartmill_ros/node_main.h"

int main(int argc, char** argv) {
  return smartmill::runNode<smartmill::loadmeter::LoadMeterNode>(argc, argv, "loadmeter");
}
