// rosrun smartmill_studies sim_effect_table docs/effects.md: writes the catalogue of effects into the
// documentation.

#include <string>

#include "smartmill_core/io/text_file.h"
#include "smartmill_core/model/effect_catalogue.h"
#include "smartmill_core/program.h"

int main(int argc, char** argv) {
  smartmill::CommandLine line("Writes the catalogue of effects as a table into a document.");
  std::string file;
  line.option("document", file, "docs/effects.md").required().existingFile();
  return smartmill::runProgram(line, argc, argv, [&] {
    smartmill::writeText(file, smartmill::withEffectTable(smartmill::readText(file)));
  });
}
