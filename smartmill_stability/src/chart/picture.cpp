#include "smartmill_stability/chart/picture.h"

#include <filesystem>

#include "smartmill_core/io/gnuplot.h"
#include "smartmill_core/units.h"

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

void drawProbabilities(const std::string& csv, std::size_t depths, double deepest, const std::string& title,
                       const std::string& marks) {
  // A limit above the largest depth is an empty cell: the line leaves the picture.
  const double outside = 1.1 * deepest / units::MM;
  drawPicture(csv,
              "set xlabel 'Spindle speed [rpm]'\nset ylabel 'Axial depth [mm]'\nset cblabel 'Probability "
              "of chatter'\nset cbrange [0:1]\nset palette defined (0 'white', 0.05 'light-green', 0.5 "
              "'orange', 1 'dark-red')\nset view map\nset autoscale fix\nset key opaque\n" +
                  marks +
                  "plot %FILE skip 1 using 1:2:3 with image notitle, %FILE skip 1 using 1:(strlen(strcol(4)) "
                  "? real(strcol(4)) : " +
                  std::to_string(outside) + ") every " + std::to_string(depths) +
                  " noautoscale with lines lw 2 lc 'black' title '" + title + "'");
}

}  // namespace smartmill::stability
