#include "smartmill_cnc/commands.h"

int main(int argc, char** argv) {
  return smartmill::runCommand(smartmill::cnc::fetchProgramCommand(), argc, argv);
}
