#include "smartmill_cli/commands.h"

int main(int argc, char** argv) {
  return smartmill::runCommands(smartmill::smartmillProgram(), argc, argv);
}
