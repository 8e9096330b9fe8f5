// rosrun smartmill_studies sim_effect_table docs/effects.md: writes the catalogue of effects into the
// document that people read.

#include <exception>
#include <fstream>
#include <iostream>
#include <sstream>
#include <string>

#include <CLI/CLI.hpp>

#include "smartmill_core/error.h"
#include "smartmill_core/model/effect_catalogue.h"

int main(int argc, char** argv) {
  std::string file;
  CLI::App app{"Writes the catalogue of effects as a table into a document."};
  app.add_option("document", file, "docs/effects.md")->required()->check(CLI::ExistingFile);
  CLI11_PARSE(app, argc, argv);
  try {
    std::ostringstream text;
    text << std::ifstream(file).rdbuf();
    const std::string made = smartmill::withEffectTable(text.str());
    std::ofstream out(file);
    out << made;
    if (!out.flush()) throw smartmill::Error(file + ": cannot be written");
  } catch (const std::exception& e) {
    std::cerr << "sim_effect_table: " << file << ": " << e.what() << "\n";
    return 1;
  }
  return 0;
}
