#include "smartmill_loadmeter/commands.h"

int main(int argc, char** argv) {
  return smartmill::runCommand(smartmill::loadmeter::axisDriveCommand(), argc, argv);
}
