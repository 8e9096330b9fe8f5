#pragma once

namespace smartmill {

/// Called by main() of a node. Defined once per node with runNode() (run_node.h), in the source of the node
/// class, so that the source of main() includes neither that class nor ROS.
int nodeMain(int argc, char** argv);

}  // namespace smartmill
