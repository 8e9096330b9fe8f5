#include "smartmill_discrepancy/commands.h"

int main(int argc, char** argv) {
  return smartmill::runCommand(smartmill::discrepancy::explainCommand(), argc, argv);
}
