#pragma once

namespace smartmill {

/// All that main() of a node does. Every node's program defines it once, with runNode() (run_node.h) in the
/// source of the node's class, so that the main need not read that class and ROS once more.
int nodeMain(int argc, char** argv);

}  // namespace smartmill
