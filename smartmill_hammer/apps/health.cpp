#include "smartmill_hammer/commands.h"

int main(int argc, char** argv) {
  return smartmill::runCommand(smartmill::hammer::healthCommand(), argc, argv);
}
