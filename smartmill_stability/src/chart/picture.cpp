#include "smartmill_stability/chart/picture.h"

#include <filesystem>

#include "smartmill_core/io/gnuplot.h"

namespace smartmill::stability {

void drawPicture(const std::string& csv, std::string commands) {
  const std::string placeholder = "%FILE", file = Gnuplot::quoted(csv);
  for (std::size_t at = 0; (at = commands.find(placeholder, at)) != std::string::npos; at += file.size()) {
    commands.replace(at, placeholder.size(), file);
  }
  Gnuplot plot(std::filesystem::path(csv).replace_extension(".png").string(), 1100, 600, 12);
  plot << "set datafile separator ','\nset grid\nset key top left\n" << commands << "\n";
  plot.draw();
}

}  // namespace smartmill::stability
