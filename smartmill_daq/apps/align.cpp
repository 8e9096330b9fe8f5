#include "smartmill_daq/commands.h"

int main(int argc, char** argv) {
  return smartmill::runCommand(smartmill::daq::alignCommand(), argc, argv);
}
