#include "smartmill_sim/commands.h"

int main(int argc, char** argv) {
  return smartmill::runCommand(smartmill::sim::hideCommand(), argc, argv);
}
