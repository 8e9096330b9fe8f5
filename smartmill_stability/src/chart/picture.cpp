#include "smartmill_stability/chart/picture.h"

#include <cstdio>
#include <filesystem>

#include "smartmill_core/error.h"

namespace smartmill::stability {

void drawBeside(const std::string& csv, std::string commands) {
  // In gnuplot's single quotes only the quote itself means something.
  const auto quoted = [](const std::string& name) {
    std::string text = "'";
    for (const char c : name) text += c == '\'' ? std::string("''") : std::string(1, c);
    return text + "'";
  };
  const std::string mark = "%FILE", file = quoted(csv);
  for (std::size_t at = 0; (at = commands.find(mark, at)) != std::string::npos; at += file.size()) {
    commands.replace(at, mark.size(), file);
  }
  const std::string png = std::filesystem::path(csv).replace_extension(".png").string();
  FILE* pipe = popen("gnuplot", "w");
  if (!pipe) throw Error("gnuplot cannot be started");
  std::fprintf(
      pipe,
      "set terminal pngcairo size 1100,600 font 'sans,12'\nset output %s\nset datafile separator ','\n"
      "set grid\nset key top left\n%s\n",
      quoted(png).c_str(), commands.c_str());
  if (pclose(pipe) != 0) throw Error(png + ": gnuplot failed");
}

}  // namespace smartmill::stability
