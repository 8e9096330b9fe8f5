#include "program/real_programs.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>

#include "smartmill_core/error.h"
#include "smartmill_core/formatted.h"
#include "smartmill_core/units.h"

namespace smartmill {
namespace {

using units::MM;

constexpr double CLEARANCE = 5.0;  // [mm] above the stock and next to it
constexpr double RETRACT = 15.0;   // [mm] above the stock between operations

/// Number as a post writes it: "12.5", "-3.", "0.".
std::string numberText(double value) {
  std::string text = formatted("%.3f", value);
  while (text.back() == '0') text.pop_back();
  return text == "-0." ? "0." : text;
}

/// A tool of the program, its speed and its feed per tooth.
struct ProgramTool {
  int number;
  double diameter;  // [mm]
  int teeth;
  double corner;  // [mm]
  double rpm;
  double feed(double per_tooth) const { return per_tooth * teeth * rpm; }  // [mm/min] from [mm]
  ToolGeometry geometry() const {
    ToolGeometry tool;
    tool.teeth = teeth;
    tool.diameter = diameter * MM;
    tool.helix = units::radFromDeg(30.0);
    tool.edge.corner_radius = corner * MM;
    return tool;
  }
};

/// A post processor: lengths in mm, modal words once.
class Post {
 public:
  Post(Control control, int number, const std::string& title, const std::vector<ProgramTool>& tools,
       double top)
      : control_(control), top_(top) {
    text_ = "%\n";
    text_ +=
        control == Control::fanuc ? formatted("O%04d (%s)\n", number, title.c_str()) : "(" + title + ")\n";
    for (const ProgramTool& tool : tools)
      text_ += formatted("(T%d  D=%s CR=%s - %s END MILL)\n", tool.number, numberText(tool.diameter).c_str(),
                         numberText(tool.corner).c_str(), tool.corner > 0.0 ? "BALL" : "FLAT");
    block("G90 G94 G17 G49 G40 G80");
    block("G21");
    if (control == Control::linuxcnc) block("G64 P0.002");
    home();
  }

  /// An operation: the tool change where the tool is another one, then to a point above the stock.
  void operation(const std::string& title, const ProgramTool& tool, double x, double y) {
    text_ += "(" + title + ")\n";
    if (tool_ != tool.number) {
      if (tool_ != 0) {
        block("M9");
        block("M5");
        home();
      }
      tool_ = tool.number;
      block(formatted("T%d M6", tool.number));
      block(formatted("S%.0f M3", tool.rpm));
      block("G54");
      block("M8");
      block(control_ == Control::fanuc ? "G4 X2." : "G4 P2.");
      place_ = {};
      motion_ = -1;
      feed_.reset();
      rapid(x, y, std::nullopt);
      block(formatted("G43 Z%s H%d", numberText(top_ + RETRACT).c_str(), tool.number));
      place_[2] = top_ + RETRACT;
    } else {
      rapid(std::nullopt, std::nullopt, top_ + RETRACT);
      rapid(x, y, std::nullopt);
    }
    rapid(std::nullopt, std::nullopt, top_ + CLEARANCE);
  }

  using Coordinate = std::optional<double>;
  void rapid(Coordinate x, Coordinate y, Coordinate z) { move(0, {x, y, z}, "", 0.0); }
  void line(Coordinate x, Coordinate y, Coordinate z, double feed) { move(1, {x, y, z}, "", feed); }
  /// Counterclockwise about a centre, full where it ends at its start. @param z of a helix
  void arc(double x, double y, double cx, double cy, double feed, Coordinate z = std::nullopt) {
    const std::string centre = " I" + numberText(cx - *place_[0]) + " J" + numberText(cy - *place_[1]);
    const bool full = x == *place_[0] && y == *place_[1];
    move(3, {full ? Coordinate() : x, full ? Coordinate() : y, z}, centre, feed);
  }

  std::string end() {
    block("M9");
    block("M5");
    home();
    block("M30");
    return text_ + "%\n";
  }

 private:
  /// LinuxCNC states the line of the file, not the N word.
  void block(const std::string& words) {
    text_ += control_ == Control::fanuc ? formatted("N%d %s\n", number_ += 5, words.c_str()) : words + "\n";
  }
  void home() {
    block("G28 G91 Z0.");
    block("G90");
  }
  void move(int motion, const std::array<Coordinate, 3>& to, const std::string& centre, double feed) {
    std::string words;
    for (std::size_t a = 0; a < 3; ++a) {
      if (!to[a] || (place_[a] && std::abs(*place_[a] - *to[a]) < 5e-4)) continue;
      words += formatted(" %c%s", "XYZ"[a], numberText(*to[a]).c_str());
      place_[a] = std::round(*to[a] * 1e3) / 1e3;
    }
    words += centre;
    if (words.empty()) return;
    const bool arc = motion >= 2;
    std::string head = motion == motion_ && !arc ? "" : formatted(" G%d", motion);
    motion_ = motion;
    if (motion > 0 && feed_ != feed) words += formatted(" F%s", numberText(feed).c_str());
    if (motion > 0) feed_ = feed;
    block((head + words).substr(1));
  }

  Control control_;
  std::string text_;
  double top_;  // [mm]
  int number_ = 0, tool_ = 0, motion_ = -1;
  std::array<Coordinate, 3> place_;  // [mm]
  std::optional<double> feed_;       // [mm/min]
};

/// The corner of the stock of least X and Y, and its top [mm].
struct Corner {
  double x, y, top;
  explicit Corner(const Workpiece& stock)
      : x(stock.low[0] / MM), y(stock.low[1] / MM), top(stock.high[2] / MM) {
    constexpr double LENGTH = 130.0, WIDTH = 110.0, HEIGHT = 8.0;
    if (stock.high[0] / MM - x < LENGTH || stock.high[1] / MM - y < WIDTH ||
        stock.high[2] / MM - stock.low[2] / MM < HEIGHT)
      throw Error(formatted("stock: expected at least %g x %g x %g mm", LENGTH, WIDTH, HEIGHT));
  }
};

std::map<int, ToolGeometry> geometries(const std::vector<ProgramTool>& tools) {
  std::map<int, ToolGeometry> all;
  for (const ProgramTool& tool : tools) all[tool.number] = tool.geometry();
  return all;
}

/// Passes along the side of the stock at X, from outside to outside: two steps with two feeds.
void millSide(Post& post, const Corner& corner, const ProgramTool& tool, double depth) {
  const double outside = 0.5 * tool.diameter + CLEARANCE, length = 100.0;
  double x = corner.x - 0.5 * tool.diameter;
  for (const double per_tooth : {0.12, 0.05}) {
    x += 0.25 * tool.diameter;
    post.rapid(x, corner.y - outside, std::nullopt);
    post.rapid(std::nullopt, std::nullopt, corner.top - depth);
    // Along +y the material is on the right: down-milling.
    post.line(std::nullopt, corner.y + length, std::nullopt, tool.feed(per_tooth));
    post.line(corner.x - outside, std::nullopt, std::nullopt, tool.feed(per_tooth));
    post.rapid(std::nullopt, std::nullopt, corner.top + CLEARANCE);
  }
}

}  // namespace

RealPart adaptivePocket(const Workpiece& stock, Control control) {
  constexpr double DEPTH = 2.0, ENTRY = 5.0, PITCH = 0.8, STEP = 1.6;  // [mm]
  constexpr int RINGS = 6, LOOPS = 6;
  const Corner corner(stock);
  const ProgramTool rough{1, 16.0, 4, 0.0, 5000.0}, finish{2, 10.0, 3, 0.0, 6000.0};
  const double cx = corner.x + 70.0, cy = corner.y + 50.0, floor = corner.top - DEPTH;
  Post post(control, 1001, "ADAPTIVE POCKET", {rough, finish}, corner.top);

  post.operation("SIDE", rough, corner.x - 20.0, corner.y - 20.0);
  millSide(post, corner, rough, DEPTH);

  post.operation("ADAPTIVE CLEARING", rough, cx + ENTRY, cy);
  const double feed = rough.feed(0.08);
  post.line(std::nullopt, std::nullopt, corner.top + 0.4, feed);
  for (double z = corner.top + 0.4 - PITCH; z > floor - 0.5 * PITCH; z -= PITCH)
    post.arc(cx + ENTRY, cy, cx, cy, 0.5 * feed, std::max(z, floor));
  post.arc(cx + ENTRY, cy, cx, cy, 0.5 * feed);
  double r = ENTRY, side = 1.0;
  for (int ring = 0; ring < RINGS; ++ring) {
    // Half an arc outwards, then the whole ring.
    post.arc(cx - side * (r + STEP), cy, cx - side * 0.5 * STEP, cy, feed);
    r += STEP;
    side = -side;
    post.arc(cx + side * r, cy, cx, cy, feed);
  }
  const double wall = r;
  const double loop = 6.0, advance = 1.0;
  double x = cx + wall - loop;
  post.arc(cx + wall, cy, cx, cy, feed);
  for (int k = 0; k < LOOPS; ++k) {
    x += advance;
    post.line(x + loop, cy, std::nullopt, feed);
    post.arc(x + loop, cy, x, cy, feed);
  }

  post.operation("WALL FINISHING", finish, cx, cy);
  post.rapid(std::nullopt, std::nullopt, corner.top + 0.5);
  post.line(std::nullopt, std::nullopt, floor, finish.feed(0.03));
  double last = 0.0;
  for (const double per_tooth : {0.1, 0.05}) {
    // The wall of the roughing is at its ring and radius.
    const double to = wall + 0.5 * rough.diameter - 0.5 * finish.diameter + (per_tooth > 0.07 ? 0.5 : 0.8);
    const double lead = 4.0;
    const double start = last == 0.0 ? cx : cx - last;
    post.line(start, cy, std::nullopt, finish.feed(0.1));
    post.line(cx - to + lead, cy, std::nullopt, finish.feed(0.1));
    post.arc(cx - to, cy, cx - to + 0.5 * lead, cy, finish.feed(per_tooth));
    post.arc(cx - to, cy, cx, cy, finish.feed(per_tooth));
    post.line(cx - to + lead, cy, std::nullopt, finish.feed(0.1));
    last = to - lead;
  }
  post.operation("GROOVE", finish, corner.x - 12.0, corner.y + 86.0);
  for (const double per_tooth : {0.08, 0.04}) {
    post.rapid(std::nullopt, std::nullopt, corner.top - (per_tooth > 0.06 ? 1.0 : 1.8));
    post.line(corner.x + 50.0, std::nullopt, std::nullopt, finish.feed(per_tooth));
    post.rapid(std::nullopt, std::nullopt, corner.top + CLEARANCE);
    post.rapid(corner.x - 12.0, std::nullopt, std::nullopt);
  }
  return {"adaptive_pocket", post.end(), geometries({rough, finish})};
}

RealPart thinRib(const Workpiece& stock, Control control) {
  constexpr double DEPTH = 4.0, LENGTH = 90.0, WIDTH = 30.0, RIB = 3.0, LEFT = 0.6;  // [mm]
  constexpr double CORNER = 12.0;                                                    // [mm] of the path
  const Corner corner(stock);
  const ProgramTool rough{1, 16.0, 4, 0.0, 4200.0}, finish{2, 10.0, 3, 0.0, 6400.0};
  const double rib = corner.y + 55.0, outside = corner.x - 0.5 * rough.diameter - CLEARANCE;
  Post post(control, 1002, "THIN RIB", {rough, finish}, corner.top);
  // Pocket on one side of the rib: levels of 1 mm, a slot and a ring with smoothed corners about it.
  for (const double side : {-1.0, 1.0}) {
    post.operation(side < 0.0 ? "POCKET 1" : "POCKET 2", rough, outside, rib);
    const double y = rib + side * (0.5 * RIB + LEFT + 0.5 * WIDTH);
    const double half = 0.5 * (WIDTH - rough.diameter), end = corner.x + LENGTH - 0.5 * rough.diameter;
    const double radius = std::min(CORNER, half);
    for (double z = 1.0; z <= DEPTH + 1e-9; z += 1.0) {
      post.rapid(outside, y, std::nullopt);
      post.rapid(std::nullopt, std::nullopt, corner.top - z);
      post.line(end - half, std::nullopt, std::nullopt, rough.feed(0.1));
      post.rapid(outside, std::nullopt, std::nullopt);
      post.rapid(std::nullopt, y - half, std::nullopt);
      post.line(end - radius, std::nullopt, std::nullopt, rough.feed(0.14));
      post.arc(end, y - half + radius, end - radius, y - half + radius, rough.feed(0.14));
      post.line(std::nullopt, y + half - radius, std::nullopt, rough.feed(0.14));
      post.arc(end - radius, y + half, end - radius, y + half - radius, rough.feed(0.14));
      post.line(outside, std::nullopt, std::nullopt, rough.feed(0.14));
      post.rapid(std::nullopt, std::nullopt, corner.top + CLEARANCE);
    }
  }
  // Both sides in turn, so that the rib is always supported below; down-milling.
  const double from = corner.x - 0.5 * finish.diameter - CLEARANCE;
  const double to = corner.x + LENGTH - rough.diameter - CORNER;
  post.operation("RIB FINISHING", finish, from, rib);
  for (double z = 2.0; z <= DEPTH + 1e-9; z += 2.0) {
    for (const double left : {0.25, 0.0}) {
      for (const double side : {-1.0, 1.0}) {
        const double y = rib + side * (0.5 * RIB + left + 0.5 * finish.diameter),
                     feed = finish.feed(left > 0.1 ? 0.1 : 0.05);
        const double first = side < 0.0 ? to : from, last = side < 0.0 ? from : to;
        // From the open side in the pocket, away from the rib, to the begin of the pass.
        if (side < 0.0) {
          post.rapid(from, y - 2.0, std::nullopt);
          post.rapid(std::nullopt, std::nullopt, corner.top - z);
          post.line(first, std::nullopt, std::nullopt, finish.feed(0.15));
          post.line(std::nullopt, y, std::nullopt, feed);
        } else {
          post.rapid(first, y, std::nullopt);
          post.rapid(std::nullopt, std::nullopt, corner.top - z);
        }
        post.line(last, std::nullopt, std::nullopt, feed);
        if (side > 0.0) post.line(std::nullopt, y + 2.0, std::nullopt, feed);
        post.rapid(std::nullopt, std::nullopt, corner.top + CLEARANCE);
      }
    }
  }
  return {"thin_rib", post.end(), geometries({rough, finish})};
}

RealPart scallopSurface(const Workpiece& stock, Control control) {
  constexpr double LENGTH = 60.0, WIDTH = 40.0, SAGITTA = 3.0, LEFT = 0.4;  // [mm]
  constexpr double SCALLOP = 0.02;                                          // [mm] height
  const Corner corner(stock);
  const ProgramTool rough{1, 16.0, 4, 0.0, 4200.0}, finish{3, 8.0, 2, 4.0, 8000.0};
  // A cylinder along y whose lowest line is at the side of the stock.
  const double radius = 0.5 * (WIDTH * WIDTH + SAGITTA * SAGITTA) / SAGITTA;
  const auto surface = [&](double x) {  // below the top
    const double along = x - corner.x;
    return SAGITTA - (radius - std::sqrt(radius * radius - along * along));
  };
  Post post(control, 1003, "SCALLOP SURFACE", {rough, finish}, corner.top);
  const double outside = 0.5 * rough.diameter + CLEARANCE;
  post.operation("TERRACES", rough, corner.x - outside, corner.y - outside);
  for (const double z : {1.0, 2.0}) {
    // Lines along y, as far as the surface with its allowance is below the terrace.
    for (double x = corner.x - 0.2 * rough.diameter; surface(x + 0.5 * rough.diameter) - LEFT > z;
         x += 0.4 * rough.diameter) {
      post.rapid(x, corner.y - outside, std::nullopt);
      post.rapid(std::nullopt, std::nullopt, corner.top - z);
      post.line(std::nullopt, corner.y + LENGTH, std::nullopt, rough.feed(z > 1.5 ? 0.06 : 0.12));
      post.rapid(std::nullopt, std::nullopt, corner.top + CLEARANCE);
    }
  }
  // Scallop h of a ball of radius r: step 2 sqrt(2 r h) along the surface, nearly that along x.
  const double step = 2.0 * std::sqrt(2.0 * finish.corner * SCALLOP), way = 0.5 * finish.diameter + 3.0;
  post.operation("RASTER", finish, corner.x, corner.y - way);
  double x = corner.x;
  for (int line = 0; surface(x) > 0.6 && line < 30; ++line) {
    // The ball touches the surface at x: its centre is on the normal.
    const double sine = (x - corner.x) / radius, cosine = std::sqrt(1.0 - sine * sine);
    post.rapid(x - finish.corner * sine, corner.y - way, std::nullopt);
    post.rapid(std::nullopt, std::nullopt, corner.top - surface(x) + finish.corner * (cosine - 1.0));
    post.line(std::nullopt, corner.y + LENGTH, std::nullopt, finish.feed(line % 2 == 0 ? 0.1 : 0.05));
    post.rapid(std::nullopt, std::nullopt, corner.top + CLEARANCE);
    x += step;
  }
  return {"scallop_surface", post.end(), geometries({rough, finish})};
}

std::vector<RealPart> realParts(const Workpiece& stock, Control control) {
  return {adaptivePocket(stock, control), thinRib(stock, control), scallopSurface(stock, control)};
}

}  // namespace smartmill
