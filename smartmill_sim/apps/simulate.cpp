#include "smartmill_sim/commands.h"

int main(int argc, char** argv) {
  return smartmill::runCommand(smartmill::sim::simulateCommand(), argc, argv);
}
