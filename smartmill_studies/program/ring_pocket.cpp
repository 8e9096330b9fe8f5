#include "program/ring_pocket.h"

#include <algorithm>
#include <cmath>

#include "smartmill_core/formatted.h"
#include "smartmill_core/units.h"

namespace smartmill {
namespace {

using units::PI;

constexpr double X = 60.0, Y = 40.0;  // [mm] centre of the pocket

/// Blocks of lines and arcs, or of chords of a length [mm].
class PocketProgram {
 public:
  explicit PocketProgram(double chord) : chord_(chord) {
    text_ = "G21 G90 G17\nS6000 M3\nG0 X62 Y40 Z5\n";
    for (int level = 0; level < 5; ++level) addLevel(-2.0 * level);
    text_ += "M30\n";
  }
  const std::string& text() const { return text_; }

 private:
  void addLevel(double top) {
    text_ += formatted("G0 X62 Y40 Z%.1f\nG1 Z%.1f F600\nG3 Z%.1f I-2 F800\nG3 Z%.1f I-2\nG3 I-2 F1800\n",
                       top + 1, top, top - 1, top - 2);
    x_ = X + 2.0;
    y_ = Y;
    for (int loop = 1; loop <= 6; ++loop) {
      const double h = 2.0 + 4.0 * loop, w = h + 20.0, r = 2.0;
      line(X + w, Y);
      line(X + w, Y + h - r);
      corner(X + w - r, Y + h - r, r, 0.0);
      line(X - w + r, Y + h);
      corner(X - w + r, Y + h - r, r, 0.5 * PI);
      line(X - w, Y - h + r);
      corner(X - w + r, Y - h + r, r, PI);
      line(X + w - r, Y - h);
      corner(X + w - r, Y - h + r, r, 1.5 * PI);
      line(X + w, Y);
    }
    text_ += "G0 Z5\n";
  }
  void line(double x, double y) {
    const int count = chord_ > 0.0 ? std::max(1, static_cast<int>(std::hypot(x - x_, y - y_) / chord_)) : 1;
    for (int k = 1; k <= count; ++k)
      text_ += formatted("G1 X%.4f Y%.4f\n", x_ + (x - x_) * k / count, y_ + (y - y_) * k / count);
    x_ = x;
    y_ = y;
  }
  void corner(double cx, double cy, double r, double from) {
    const double x = cx + r * std::cos(from + 0.5 * PI), y = cy + r * std::sin(from + 0.5 * PI);
    if (chord_ == 0.0) text_ += formatted("G3 X%.4f Y%.4f R%.4f\n", x, y, r);
    const int count = chord_ > 0.0 ? std::max(1, static_cast<int>(0.5 * PI * r / chord_)) : 0;
    for (int k = 1; k <= count; ++k) {
      const double angle = from + 0.5 * PI * k / count;
      text_ += formatted("G1 X%.4f Y%.4f\n", cx + r * std::cos(angle), cy + r * std::sin(angle));
    }
    x_ = x;
    y_ = y;
  }

  std::string text_;
  double chord_, x_ = X, y_ = Y;
};

}  // namespace

std::string ringPocket(double chord) {
  return PocketProgram(chord / units::MM).text();
}

}  // namespace smartmill
