// rosrun smartmill_studies gallery -o DIR: reproduces the figures and tables of the documents.

#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <string>
#include <vector>

#include "gallery/gallery.h"
#include "gallery/page.h"
#include "smartmill_core/error.h"
#include "smartmill_core/program.h"

namespace {

using namespace smartmill;
using namespace smartmill::studies;

std::vector<Figure> chosen(const std::vector<std::string>& names) {
  const std::vector<Figure> all = allFigures();
  if (names.empty()) return all;
  std::vector<Figure> some;
  for (const std::string& name : names) {
    const auto at = std::find_if(all.begin(), all.end(), [&](const Figure& f) { return f.name == name; });
    if (at == all.end()) throw UsageError("no figure has the name \"" + name + "\"; --list prints all names");
    some.push_back(*at);
  }
  return some;
}

void list() {
  for (const Figure& figure : allFigures())
    std::printf("%-24s %s\n", figure.name.c_str(), figure.title.c_str());
}

void run(const std::vector<Figure>& figures, const std::string& folder, unsigned seed) {
  std::filesystem::create_directories(folder);
  std::vector<DrawnFigure> drawn_figures;
  std::vector<Compared> rows;
  for (const Figure& figure : figures) {
    std::fprintf(stderr, "%zu of %zu: %s\n", drawn_figures.size() + 1, figures.size(), figure.name.c_str());
    try {
      drawn_figures.push_back({figure, figure.draw(folder, seed)});
    } catch (const Error& error) {
      throw Error(figure.name + ": " + error.what());
    }
    for (const Compared& row : drawn_figures.back().drawn.rows) {
      std::printf("%-15s %-8s %s: seed %s, here %s\n", nameOf(row.kind), nameOf(row.verdict),
                  row.what.c_str(), row.seed.c_str(), row.ours.c_str());
      rows.push_back(row);
    }
  }
  const std::string page = folder + "/gallery.html";
  writePage(drawn_figures, seed, page);
  for (const Kind kind : KINDS) std::printf("%s\n", summaryOf(rows, kind).c_str());
  std::printf("%s\n", page.c_str());
}

}  // namespace

int main(int argc, char** argv) {
  std::setvbuf(stdout, nullptr, _IOLBF, 0);
  std::string folder = "gallery";
  std::vector<std::string> names;
  unsigned seed = 1;
  bool only_list = false;
  CommandLine line(
      "Reproduces the figures and tables of the source documents of this project, with their numbers next to "
      "those computed here: pictures and gallery.html.");
  line.option("-o,--out", folder, "folder").showDefault();
  line.option("--only", names, "only these figures");
  line.option("--seed", seed).showDefault();
  line.flag("--list", only_list, "print the names of the figures");
  return runProgram(line, argc, argv, [&] { only_list ? list() : run(chosen(names), folder, seed); });
}
