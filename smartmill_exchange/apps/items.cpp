#include "smartmill_exchange/commands.h"

int main(int argc, char** argv) {
  return smartmill::runCommand(smartmill::exchange::itemsCommand(), argc, argv);
}
