#include "smartmill_program/commands.h"

int main(int argc, char** argv) {
  return smartmill::runCommand(smartmill::program::programCommand(), argc, argv);
}
