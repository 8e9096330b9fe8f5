#include "smartmill_recording/commands.h"

int main(int argc, char** argv) {
  return smartmill::runCommand(smartmill::recording::accountCommand(), argc, argv);
}
