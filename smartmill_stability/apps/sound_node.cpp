#include "smartmill_ros/node_main.h"

int main(int argc, char** argv) {
  return smartmill::nodeMain(argc, argv);
}
