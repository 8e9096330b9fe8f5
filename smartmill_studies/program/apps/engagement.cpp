// rosrun smartmill_studies program_engagement: engagement of random paths against references that share no
// code with the simulation of the material: distances from the earlier paths for flat end mills on level
// paths, points in the swept tool for bull-nose and ball mills on paths in three axes. Developed with seed 1
// (30 paths); counted with seeds 2026 (level reference: polygons with chords of 0.2 um, too coarse near the
// tangent of an arc) and 2027:
//   --cases 250 --seed 2027

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <random>
#include <vector>

#include <nlohmann/json.hpp>

#include "smartmill_core/program.h"
#include "smartmill_core/units.h"
#include "smartmill_program/engagement/cut_simulation.h"
#include "study_case.h"

namespace {

using namespace smartmill;
using namespace smartmill::program;
using units::MM;
using units::PI;
using units::radFromDeg;

constexpr int LEVEL_SHARE = 5;        // four of five cases are level paths
constexpr double ANGLE_STEP = 0.1;    // [deg] of the references
constexpr double SAME_ANGLE = 0.5;    // [deg] that may differ in a step, per end of an arc
constexpr double SAME_DEPTH = 0.05;   // [1], or 20 um
constexpr double THIN = 1e-6;         // [m]
constexpr double LEAST_DEPTH = 2e-6;  // [m]
constexpr int TESTED_STEPS = 25;      // of a path
const StockBlock BLOCK{{0, 0, -10 * MM}, {60 * MM, 45 * MM, 0}};

struct Arguments {
  int cases = 250;
  std::uint64_t seed = 1;
};

/// A path of lines and arcs that begins and ends outside of the block or in it.
std::vector<Move> drawPath(std::mt19937_64& random, bool level, double radius) {
  std::uniform_real_distribution<double> x(-8 * MM, 68 * MM), y(-8 * MM, 53 * MM), depth(-6 * MM, -0.3 * MM),
      rise(-2 * MM, 2 * MM), turn(0.3, 4.0), arc_radius(0.3, 3.0);
  std::vector<Move> moves;
  double z = depth(random);
  nc::PathSegment::Point at{x(random), -2 * radius, z};
  for (int k = 0; k < 14; ++k) {
    Move move;
    move.line = k + 1;
    move.operation = "path";
    move.feed = 0.01;
    move.spindle_speed = 300.0;
    if (level && random() % 3 == 0) {  // an arc about a centre near the present place
      const double r = arc_radius(random) * radius,
                   heading = 2.0 * PI * static_cast<double>(random() % 1000) / 1000.0;
      const std::array<double, 2> centre{at[0] + r * std::cos(heading), at[1] + r * std::sin(heading)};
      const bool clockwise = random() % 2 == 0;
      const double angle = heading + PI + (clockwise ? -1.0 : 1.0) * turn(random);
      move.path = nc::PathSegment::arc(
          at, {centre[0] + r * std::cos(angle), centre[1] + r * std::sin(angle), z}, centre, clockwise);
    } else {
      if (level && random() % 5 == 0) z = depth(random);
      const double target = level ? z : std::clamp(at[2] + rise(random), -6 * MM, -0.3 * MM);
      if (level) at[2] = z;  // a new level begins where the last one ended
      move.path = nc::PathSegment::line(at, {x(random), y(random), target});
    }
    at = move.path.target();
    moves.push_back(move);
  }
  return moves;
}

/// [m] Distance of a point in the plane from a level path up to a distance [m] along it.
double distanceFrom(const nc::PathSegment& path, double to, double x, double y) {
  const nc::PathSegment::Point &a = path.start(), b = path.at(to);
  const double to_ends = std::min(std::hypot(x - a[0], y - a[1]), std::hypot(x - b[0], y - b[1]));
  if (!path.isArc()) {
    const double dx = b[0] - a[0], dy = b[1] - a[1], square = dx * dx + dy * dy;
    const double share = square > 0.0 ? ((x - a[0]) * dx + (y - a[1]) * dy) / square : 0.0;
    return share > 0.0 && share < 1.0 ? std::abs((x - a[0]) * dy - (y - a[1]) * dx) / std::sqrt(square)
                                      : to_ends;
  }
  const double cx = x - path.centre()[0], cy = y - path.centre()[1];
  double turned = std::atan2(cy, cx) - path.startAngle();
  if (path.sweep() < 0.0) turned = -turned;
  while (turned < 0.0) turned += 2.0 * PI;
  while (turned >= 2.0 * PI) turned -= 2.0 * PI;
  const bool reached = turned <= std::abs(path.sweep()) * to / path.length();
  return reached ? std::min(to_ends, std::abs(std::hypot(cx, cy) - path.radius())) : to_ends;
}

/// [m] Depth of the material over the tip at a point, which an earlier path has covered or not; `done` [m] of
/// the present one has.
double levelDepth(const Step& step, const std::vector<const Move*>& earlier, double radius, double done,
                  double x, double y) {
  constexpr double ROUNDING = 1e-9;  // [m]
  if (x < BLOCK.low[0] || x > BLOCK.high[0] || y < BLOCK.low[1] || y > BLOCK.high[1]) return 0.0;
  if (distanceFrom(step.move->path, done, x, y) < radius - ROUNDING) return 0.0;
  double top = BLOCK.high[2];
  for (const Move* move : earlier)
    if (distanceFrom(move->path, move->path.length(), x, y) < radius)
      top = std::min(top, move->path.start()[2]);
  return std::max(0.0, top - step.tip[2]);
}

/// Whether the depth over the angle is that of the contact.
bool sameDepths(const Contact& contact, const std::vector<double>& depths) {
  double different = 0.0;
  int ends = 0;
  for (std::size_t k = 0; k < depths.size(); ++k) {
    const double phi = radFromDeg((static_cast<double>(k) + 0.5) * ANGLE_STEP);
    double here = 0.0;
    for (const EngagedArc& arc : contact.arcs)
      if (phi >= arc.entry && phi < arc.exit) here = arc.top;
    const double expected = depths[k] > LEAST_DEPTH ? depths[k] : 0.0;
    const bool same = (here > 0.0) == (expected > 0.0) &&
                      std::abs(here - expected) <= std::max(20e-6, SAME_DEPTH * std::max(here, expected));
    if (!same) different += ANGLE_STEP;
    if (k > 0 && std::abs(depths[k] - depths[k - 1]) > LEAST_DEPTH) ++ends;
  }
  return different <= SAME_ANGLE * std::max(1, ends);
}

/// A mill with a corner, solid above its surface.
struct Solid {
  double radius, corner;                   // [m]
  double surface(double distance) const {  // [m] above the tip; infinite outside of it
    if (distance > radius) return 1.0;
    const double beyond = distance - (radius - corner);
    return beyond <= 0.0 ? 0.0 : corner - std::sqrt(std::max(0.0, corner * corner - beyond * beyond));
  }
};

/// [m] Lowest surface of the tool over a point along a straight path up to a share of it, by golden section
/// on a convex function.
double lowestOver(const Solid& solid, const nc::PathSegment& path, double share, double x, double y) {
  const nc::PathSegment::Point &a = path.start(), &b = path.target();
  const auto surface = [&](double t) {
    const double distance = std::hypot(x - a[0] - t * (b[0] - a[0]), y - a[1] - t * (b[1] - a[1]));
    return a[2] + t * (b[2] - a[2]) + solid.surface(distance) +
           (distance > solid.radius ? 10.0 * (distance - solid.radius) : 0.0);
  };
  constexpr double GOLDEN = 0.6180339887498949;
  double low = 0.0, high = share;
  double left = high - GOLDEN * (high - low), right = low + GOLDEN * (high - low), at_left = surface(left),
         at_right = surface(right);
  for (int i = 0; i < 45; ++i) {
    if (at_left < at_right) {
      high = right;
      right = left;
      at_right = at_left;
      left = high - GOLDEN * (high - low);
      at_left = surface(left);
    } else {
      low = left;
      left = right;
      at_left = at_right;
      right = low + GOLDEN * (high - low);
      at_right = surface(right);
    }
  }
  return std::min({at_left, at_right, surface(0.0), surface(share)});
}

/// [m] Height of the material above the tip that a tool of three axes meets at a point of its surface: what
/// the earlier moves have left; negative infinity where the present one has cut deeper.
double leftAbove(const Step& step, const Solid& solid, const std::vector<const Move*>& earlier, double share,
                 double x, double y, double height) {
  constexpr double ROUNDING = 1e-11;  // [m]
  const double none = -std::numeric_limits<double>::infinity();
  if (x < BLOCK.low[0] || x > BLOCK.high[0] || y < BLOCK.low[1] || y > BLOCK.high[1]) return none;
  if (lowestOver(solid, step.move->path, share - 1e-9, x, y) < step.tip[2] + height - ROUNDING) return none;
  double top = BLOCK.high[2];
  for (const Move* move : earlier) top = std::min(top, lowestOver(solid, move->path, 1.0, x, y));
  return top - step.tip[2];
}

/// Whether the contact of a tool of three axes is that of the reference: the angles of each slice of its
/// corner, the depths of its side. Material that is thinner than 1 um, the last digit of a program, is not
/// judged.
bool sameSolid(const Step& step, const Solid& solid, const std::vector<const Move*>& earlier, double share) {
  constexpr double STEP = 0.25;  // [deg]
  const nc::PathSegment& path = step.move->path;
  const double direction = std::atan2(path.target()[1] - path.start()[1], path.target()[0] - path.start()[0]);
  // The immersion angle is clockwise from the left of the feed.
  const auto above = [&](double phi, double r, double height) {
    const double x =
        step.tip[0] + r * (std::sin(phi) * std::cos(direction) - std::cos(phi) * std::sin(direction));
    const double y =
        step.tip[1] + r * (std::sin(phi) * std::sin(direction) + std::cos(phi) * std::cos(direction));
    return leftAbove(step, solid, earlier, share, x, y, height);
  };
  std::vector<double> radii;  // [m] of the slices
  Contact side;
  for (const EngagedArc& arc : step.contact.arcs) {
    if (arc.bottom < solid.corner) radii.push_back(arc.radius);
    if (arc.top > solid.corner) side.arcs.push_back({arc.entry, arc.exit, 0.0, arc.top, arc.radius});
  }
  std::vector<double> depths;
  for (double phi = 0.5 * ANGLE_STEP; phi < 180.0; phi += ANGLE_STEP) {
    const double top = above(radFromDeg(phi), solid.radius, solid.corner);
    depths.push_back(top > solid.corner + THIN ? top : 0.0);
  }
  if (!sameDepths(side, depths)) return false;
  for (const double r : radii) {
    const double beyond = std::min(solid.corner, r - (solid.radius - solid.corner));
    const double height = solid.corner - std::sqrt(solid.corner * solid.corner - beyond * beyond);
    double different = 0.0;
    int ends = 0;
    bool before = false;
    for (int k = 0; k < static_cast<int>(180.0 / STEP); ++k) {
      const double phi = radFromDeg((k + 0.5) * STEP), thickness = above(phi, r, height) - height;
      bool here = false;
      for (const EngagedArc& arc : step.contact.arcs)
        here = here || (height >= arc.bottom && height < arc.top && phi >= arc.entry && phi < arc.exit);
      const bool material = thickness > 0.0;
      if (here != material && std::abs(thickness) > THIN) different += STEP;
      if (k > 0 && material != before) ++ends;
      before = material;
    }
    if (different > SAME_ANGLE * std::max(1, ends)) return false;
  }
  return true;
}

/// [m] along a path to a point of it.
double placeOf(const nc::PathSegment& path, const nc::PathSegment::Point& point) {
  const nc::PathSegment::Point& start = path.start();
  if (!path.isArc()) return std::hypot(point[0] - start[0], point[1] - start[1], point[2] - start[2]);
  double turned = std::atan2(point[1] - path.centre()[1], point[0] - path.centre()[0]) - path.startAngle();
  if (path.sweep() < 0.0) turned = -turned;
  while (turned < 0.0) turned += 2.0 * PI;
  return turned * path.radius();
}

nlohmann::json caseOf(const Arguments& a, int number) {
  std::mt19937_64 random(seedOfCase(a.seed, number));
  const bool level = number % LEVEL_SHARE != LEVEL_SHARE - 1;
  const double radius = std::uniform_real_distribution<double>(3 * MM, 6 * MM)(random);
  const double corner = level ? 0.0 : (random() % 2 == 0 ? 1.0 : 0.3) * radius;
  ToolGeometry geometry{2, 2.0 * radius, 0.0, {}};
  geometry.edge.corner_radius = corner;
  const ToolShape tool{ToolProfile(geometry, 1.0)};
  const std::vector<Move> moves = drawPath(random, level, radius);
  Stock stock(BLOCK, 0.1 * MM);
  CutSimulation simulation(stock, [&](int) -> const ToolShape& { return tool; });
  std::vector<Step> steps;
  for (const Move& move : moves)
    simulation.run(move, [&](const Step& step) {
      if (!step.contact.empty()) steps.push_back(step);
      return true;
    });
  std::shuffle(steps.begin(), steps.end(), random);
  steps.resize(std::min<std::size_t>(steps.size(), TESTED_STEPS));
  std::sort(steps.begin(), steps.end(),
            [](const Step& one, const Step& other) { return one.move < other.move; });
  std::vector<const Move*> earlier;
  int right = 0;
  for (const Step& step : steps) {
    const Move* move = moves.data() + earlier.size();
    for (; move < step.move; ++move) earlier.push_back(move);
    const nc::PathSegment& path = step.move->path;
    const double direction = step.feed_angle;
    const double done = placeOf(path, step.tip);
    if (!level) {
      right += sameSolid(step, {radius, corner}, earlier, done / path.length()) ? 1 : 0;
      continue;
    }
    std::vector<double> depths;
    for (double phi = 0.5 * ANGLE_STEP; phi < 180.0; phi += ANGLE_STEP) {
      const double s = radius * std::sin(radFromDeg(phi)), c = radius * std::cos(radFromDeg(phi));
      depths.push_back(levelDepth(step, earlier, radius, done,
                                  step.tip[0] + s * std::cos(direction) - c * std::sin(direction),
                                  step.tip[1] + s * std::sin(direction) + c * std::cos(direction)));
    }
    right += sameDepths(step.contact, depths) ? 1 : 0;
  }
  return {{"case", number}, {"level", level}, {"steps", steps.size()}, {"right", right}};
}

void score(const std::vector<nlohmann::json>& lines) {
  for (const bool level : {true, false}) {
    int paths = 0, steps = 0, right = 0;
    for (const nlohmann::json& line : lines) {
      if (line.at("level").get<bool>() != level) continue;
      ++paths;
      steps += line.at("steps").get<int>();
      right += line.at("right").get<int>();
    }
    std::printf("%s: %d paths, %d of %d steps within 0.5 deg (%.2f %%)\n", level ? "level" : "three axes",
                paths, right, steps, 100.0 * right / std::max(1, steps));
  }
}

}  // namespace

int main(int argc, char** argv) {
  CommandLine line(
      "Engagement of random paths against distances from earlier ones (level paths, flat end mills) and "
      "points in "
      "the swept "
      "tool (three axes, bull-nose and ball mills).");
  Arguments a;
  StudyCase study;
  study.addTo(line, "--cases", a.cases, "paths; every fifth is in three axes");
  line.option("--seed", a.seed, "of all draws").showDefault();
  study.addScore(line);
  return runProgram(line, argc, argv, [&] {
    study.run(
        a.cases, [&](int number) { return caseOf(a, number); }, score);
  });
}
