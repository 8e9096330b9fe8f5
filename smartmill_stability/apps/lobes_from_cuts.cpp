#include "smartmill_stability/commands.h"

int main(int argc, char** argv) {
  return smartmill::runCommand(smartmill::stability::lobesFromCutsCommand(), argc, argv);
}
