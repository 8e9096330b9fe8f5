#include "smartmill_kalman/commands.h"

int main(int argc, char** argv) {
  return smartmill::runCommand(smartmill::kalman::cuttingFrfCommand(), argc, argv);
}
