#include "interpreter.h"

#include <algorithm>
#include <cmath>

#include "arc.h"
#include "smartmill_core/error.h"
#include "smartmill_core/formatted.h"
#include "smartmill_core/units.h"

namespace smartmill::program {
namespace {

using nc::PathSegment;
using nc::Word;
using units::MM;

constexpr double INCH = 25.4 * MM;
constexpr double PECK_CLEARANCE =
    0.25 * MM;  // [m] above the previous depth of G83 (LinuxCNC 0.254 mm, Fanuc 5115)
constexpr std::size_t MAX_MOVES = 5000000;  // 1.3 GB; a program that cuts for days
constexpr int MAX_TOOL = 9999;
constexpr int MAX_OFFSET = 999;  // D
constexpr double MAX_PECKS = 9999;
constexpr int MAX_HOLES = 9999;       // K or L
constexpr int MAX_WORK_OFFSET = 300;  // P of G54.1

int codeOf(const Word& word) {
  return static_cast<int>(*word.value);
}

}  // namespace

void Interpreter::execute(Block& block, std::size_t number, int line) {
  number_ = number;
  line_ = line;
  block.take('O');
  block.take(':');
  if (const Word* word = block.take('N')) sequence_ = nc::integer(*word);
  setModes(block);
  const std::optional<Word>& single = block.code(Group::none);
  if (single && codeOf(*single) == 4) {
    dwell(block, *single);
  } else if (single && codeOf(*single) == 52) {
    setLocalOffset(block, *single);
  } else if (single) {
    reference(block, *single, codeOf(*single) == 28);
  } else if (const auto& turn = block.code(Group::rotation); turn && codeOf(*turn) == 68) {
    // X and Y are the centre.
  } else if (hasAxes(block) || block.has('I') || block.has('J') || block.has('K')) {
    motion(block);
  }
  for (const int end : {2, 30}) ended_ = ended_ || block.function(end);
  if (ended_) compensated([&] { compensation_.cancel(); });
}

void Interpreter::compensated(const std::function<void()>& action) const {
  try {
    action();
  } catch (const Error& error) {
    fail(error.what());
  }
}

void Interpreter::fail(const std::string& message) const {
  throw Error("column " + std::to_string(motion_word_ ? motion_word_->column : 1) + ": " + message);
}

void Interpreter::setModes(Block& block) {
  if (const auto& word = block.code(Group::feed)) {
    const FeedMode mode = codeOf(*word) == 93   ? FeedMode::inverse_time
                          : codeOf(*word) == 94 ? FeedMode::per_minute
                                                : FeedMode::per_revolution;
    if (mode != feed_mode_) feed_.reset();
    feed_mode_ = mode;
  }
  if (feed_mode_ == FeedMode::inverse_time) feed_.reset();  // of its block only
  if (const auto& word = block.code(Group::units)) setUnits(*word);
  if (const Word* word = block.take('F')) {
    if (!(*word->value > 0.0)) refuse(*word, word->text() + ", expected a feed above 0");
    feed_ = feed_mode_ == FeedMode::inverse_time ? *word->value : length(*word->value);
    feed_word_ = {*word->value, 0.0, feed_mode_, line_, number_};
  }
  if (const Word* word = block.take('S')) {
    if (*word->value < 0.0) refuse(*word, word->text() + ", expected a speed of 0 or more");
    speed_ = units::radPerSecFromRpm(*word->value);
    speed_line_ = line_;
  }
  setTool(block);
  for (const int turn : {3, 4, 5})
    if (block.function(turn)) turns_ = turn == 5 ? 0 : turn;
  if (const auto& word = block.code(Group::plane)) {
    const int code = codeOf(*word);
    plane_ = code == 17 ? nc::Plane::xy : code == 18 ? nc::Plane::zx : nc::Plane::yz;
  }
  setCompensation(block);
  if (const auto& word = block.code(Group::length); word && codeOf(*word) == 43) block.take('H');
  if (block.code(Group::path)) {
    block.take('P');
    block.take('Q');
  }
  if (const auto& word = block.code(Group::work)) setWorkOffset(block, *word);
  if (const auto& word = block.code(Group::rotation)) setRotation(block, *word);
  if (const auto& word = block.code(Group::distance)) relative_ = codeOf(*word) == 91;
  if (const auto& word = block.code(Group::retract)) to_retract_plane_ = codeOf(*word) == 99;
  motion_word_.reset();
  if (const auto& word = block.code(Group::motion)) {
    motion_ = codeOf(*word);
    motion_word_ = word;
    in_cycle_ = false;
  } else if (const auto& cycle = block.code(Group::cycle)) {
    motion_ = codeOf(*cycle);
    motion_word_ = cycle;
    if (motion_ == 80) in_cycle_ = false;
  }
  operation_ = "G" + std::to_string(motion_);
}

void Interpreter::setUnits(const Word& word) {
  const double unit = codeOf(word) == 20 ? INCH : MM;
  if (unit_ && *unit_ != unit)
    refuse(word, word.text() + " after lengths in " + (unit == MM ? "inches" : "mm") +
                     ", expected one unit in the whole program");
  unit_ = unit;
}

void Interpreter::setWorkOffset(Block& block, const Word& word) {
  std::string work = formatted("G%g", *word.value);
  if (work == "G54.1") {
    const Word* number = block.take('P');
    if (!number) refuse(word, "G54.1 without P, expected the number of a work offset");
    work += "P" + std::to_string(nc::integer(*number, MAX_WORK_OFFSET));
  }
  if (work_ == work) return;
  if (rotation_ != 0.0) refuse(word, work + " under G68, expected G69 before it");
  const auto stated = options_.work_offsets.find(work);
  if (stated == options_.work_offsets.end() && work_)
    refuse(word,
           work + " after " + *work_ + ": its offset is unknown, expected --work-offset " + work + ":X:Y:Z");
  offset_ = stated == options_.work_offsets.end() ? Point{{0, 0, 0}} : stated->second;
  for (std::size_t i = 0; i < 3; ++i) offset_[i] += local_[i];
  work_ = work;
}

// A further shift of all work offsets, by the stated axes.
void Interpreter::setLocalOffset(Block& block, const Word& code) {
  if (rotation_ != 0.0) refuse(code, "G52 under G68, expected G69 before it");
  if (compensation_.active()) refuse(code, "G52 under radius compensation, expected G40 before it");
  if (!hasAxes(block)) refuse(code, "G52 without X, Y or Z");
  for (std::size_t i = 0; i < 3; ++i) {
    const Word* word = block.take(static_cast<char>('X' + i));
    if (!word) continue;
    const double local = length(*word->value);
    offset_[i] += local - local_[i];
    local_[i] = local;
  }
}

// G68 X Y R: the program's coordinates are turned counterclockwise about a point; G69: no longer.
void Interpreter::setRotation(Block& block, const Word& code) {
  const bool ends = codeOf(code) == 69;
  if (compensation_.active())
    refuse(code, code.text() + " under radius compensation, expected G40 before it");
  if (!ends && plane_ != nc::Plane::xy) refuse(code, "G68 in G18 or G19, expected G17");
  const auto turn = [this](double angle) {  // the present position
    if (!position_[0] || !position_[1]) {
      position_[0].reset();
      position_[1].reset();
      return;
    }
    const double x = *position_[0] - about_[0], y = *position_[1] - about_[1];
    position_[0] = about_[0] + std::cos(angle) * x - std::sin(angle) * y;
    position_[1] = about_[1] + std::sin(angle) * x + std::cos(angle) * y;
  };
  if (rotation_ != 0.0) turn(rotation_);
  rotation_ = 0.0;
  if (ends) return;
  const Word* angle = block.take('R');
  if (!angle) refuse(code, "G68 without R, expected the angle in degrees");
  for (std::size_t i = 0; i < 2; ++i) {
    const Word* word = block.take(static_cast<char>('X' + i));
    if (!word && !position_[i]) refuse(code, "G68 about an unknown position, expected X and Y");
    about_[i] = word ? length(*word->value) + offset_[i] : *position_[i];
  }
  rotation_ = units::radFromDeg(*angle->value);
  turn(-rotation_);
}

PathSegment Interpreter::rotated(const PathSegment& path) const {
  if (rotation_ == 0.0) return path;
  const auto turned = [this](const std::array<double, 2>& p) {
    const double x = p[0] - about_[0], y = p[1] - about_[1], c = std::cos(rotation_), s = std::sin(rotation_);
    return std::array<double, 2>{about_[0] + c * x - s * y, about_[1] + s * x + c * y};
  };
  const auto point = [&](const Point& p) {
    const std::array<double, 2> q = turned({p[0], p[1]});
    return Point{q[0], q[1], p[2]};
  };
  if (!path.isArc()) return PathSegment::line(point(path.start()), point(path.target()));
  if (path.plane() != nc::Plane::xy) fail(operation_ + " in G18 or G19 under G68, expected G17");
  return PathSegment::arc(point(path.start()), point(path.target()), turned(path.centre()),
                          path.sweep() < 0.0);
}

void Interpreter::setTool(Block& block) {
  if (const Word* word = block.take('T')) selected_tool_ = nc::integer(*word, MAX_TOOL);
  if (const Word* change = block.function(6)) {
    if (selected_tool_ == 0) refuse(*change, "M6 without a tool, expected T");
    if (compensation_.active()) refuse(*change, "M6 under radius compensation, expected G40 before it");
    tool_ = selected_tool_;
    turns_ = 0;
  }
}

void Interpreter::setCompensation(Block& block) {
  const Word* offset = block.take('D');
  if (offset) radius_offset_ = nc::integer(*offset, MAX_OFFSET);
  const auto& code = block.code(Group::cutter);
  if (offset && !code && compensation_.active())
    refuse(*offset, offset->text() + " under radius compensation, expected G40 before it");
  if (!code) return;
  if (codeOf(*code) == 40) {
    compensated([&] { compensation_.cancel(); });
    return;
  }
  if (compensation_.active())
    refuse(*code, code->text() + " under radius compensation, expected G40 before it");
  if (plane_ != nc::Plane::xy) refuse(*code, code->text() + " in G18 or G19, expected G17");
  if (!radius_offset_) refuse(*code, code->text() + " without D, expected the number of a radius offset");
  double radius = 0.0;
  const auto stated = options_.radius_offsets.find(*radius_offset_);
  if (stated != options_.radius_offsets.end()) {
    radius = stated->second;
  } else if (*radius_offset_ != 0) {
    if (!options_.tool_radius)
      refuse(*code, code->text() + ": radius offset D" + std::to_string(*radius_offset_) +
                        " is unknown, expected it in the options or the model of the tool");
    radius = options_.tool_radius(tool_);
  }
  using Side = CutterCompensation::Side;
  compensated([&] { compensation_.start(codeOf(*code) == 41 ? Side::left : Side::right, radius); });
}

double Interpreter::length(double value) {
  if (!unit_) unit_ = MM;
  return value * *unit_;
}

// P is in ms without and in s with a decimal point (Fanuc has no point there, LinuxCNC states seconds).
double Interpreter::secondsOf(const Word& word) {
  if (*word.value < 0.0) refuse(word, word.text() + ", expected a time of 0 or more");
  return word.written.find('.') == std::string::npos ? 1e-3 * *word.value : *word.value;
}

void Interpreter::dwell(Block& block, const Word& code) {
  const Word* seconds = block.take('X');
  const Word* word = block.take('P');
  if ((seconds != nullptr) == (word != nullptr))
    refuse(code, "G4 without a time, expected P in ms or X in s");
  if (seconds && *seconds->value < 0.0) refuse(*seconds, seconds->text() + ", expected a time of 0 or more");
  operation_ = "G4";
  Point here{{0, 0, 0}};
  for (std::size_t i = 0; i < 3; ++i) here[i] = position_[i].value_or(0.0);
  add(PathSegment(here), false, 0.0, word ? secondsOf(*word) : *seconds->value);
}

// G28 by way of a point to the reference position, G53 in machine coordinates: the place of both in the
// coordinates of the stock is not part of a program.
void Interpreter::reference(Block& block, const Word& code, bool by_way) {
  if (rotation_ != 0.0 && (block.has('X') || block.has('Y') || !hasAxes(block)))
    refuse(code, code.text() + " of X or Y under G68, expected G69 before it");
  std::array<bool, 3> moved{block.has('X'), block.has('Y'), block.has('Z')};
  if (!hasAxes(block)) {
    if (!by_way) refuse(code, "G53 without X, Y or Z");
    moved = {true, true, true};
  }
  operation_ = code.text();
  if (by_way) {
    const Position way = target(block);
    bool whole = true;
    for (std::size_t i = 0; i < 3; ++i) whole = whole && way[i] && position_[i];
    if (whole) rapidTo(known(way, operation_));
  } else {
    for (const char axis : {'X', 'Y', 'Z'}) block.take(axis);
  }
  for (std::size_t i = 0; i < 3; ++i)
    if (moved[i]) position_[i].reset();
  if (moved[0] || moved[1]) compensated([&] { compensation_.forget(); });
}

Interpreter::Position Interpreter::target(Block& block, bool with_z) {
  Position result = position_;
  for (std::size_t i = 0; i < (with_z ? 3u : 2u); ++i) {
    const char axis = static_cast<char>('X' + i);
    const Word* word = block.take(axis);
    if (!word) continue;
    const double value = length(*word->value);
    if (relative_ && !position_[i]) {
      // G91 G28 Z0 and similar: the axis stays where it is.
      if (value == 0.0) continue;
      refuse(*word, word->text() + " from an unknown position, expected an absolute one (G90) first");
    }
    result[i] = relative_ ? *position_[i] + value : value + offset_[i];
  }
  return result;
}

Interpreter::Point Interpreter::known(const Position& position, const std::string& what) const {
  Point point{{0, 0, 0}};
  for (std::size_t i = 0; i < 3; ++i) {
    if (!position[i])
      fail(what + " from an unknown position of " + static_cast<char>('X' + i) +
           ", expected G0 to X, Y and Z first");
    point[i] = *position[i];
  }
  return point;
}

double Interpreter::feed(const std::string& operation, double path_length) const {
  if (!feed_ && feed_mode_ == FeedMode::inverse_time)
    fail(operation + " without a feed, expected F in each block of G93");
  if (!feed_)
    fail(operation + " without a feed, expected F" +
         (feed_mode_ == FeedMode::per_revolution ? " in G95" : "") + " in or before this block");
  if (feed_mode_ == FeedMode::inverse_time) return *feed_ * path_length / 60.0;
  if (feed_mode_ == FeedMode::per_minute) return *feed_ / 60.0;
  if (!(speed_ > 0.0)) fail(operation + " in G95 without a speed, expected S");
  return *feed_ * speed_ / units::TWO_PI;
}

void Interpreter::add(const PathSegment& path, bool rapid, double feed, double dwell) {
  if (moves_.size() >= MAX_MOVES) fail("more than " + std::to_string(MAX_MOVES) + " moves");
  Move move;
  move.block = number_;
  move.line = line_;
  move.sequence = sequence_;
  move.operation = operation_;
  move.name = name_;
  move.path = rotated(path);
  move.rapid = rapid;
  move.feed = feed;
  if (feed > 0.0) {
    move.feed_word = feed_word_;
    move.feed_word.unit = feed / feed_word_.value;
  }
  move.dwell = dwell;
  move.spindle_speed = turns_ == 0 ? 0.0 : speed_;
  move.speed_line = speed_line_;
  move.left_hand = turns_ == 4;
  move.tool = tool_;
  compensated([&] { compensation_.add(move); });
}

void Interpreter::rapidTo(const Point& point) {
  const Point start = known(position_, operation_);
  if (start != point) add(PathSegment::line(start, point), true, 0.0);
  for (std::size_t i = 0; i < 3; ++i) position_[i] = point[i];
}

void Interpreter::motion(Block& block) {
  if (motion_ == -1 || motion_ == 80)
    fail(std::string("axis words without a motion") + (motion_ == 80 ? " after G80" : "") +
         ", expected G0, G1, G2 or G3");
  if (motion_ > 70) {
    cycle(block);
    return;
  }
  const Position to = target(block);
  if (motion_ >= 2) {
    arc(block, to);
  } else if (motion_ == 1) {
    const Point start = known(position_, operation_), end = known(to, operation_);
    const PathSegment path = PathSegment::line(start, end);
    const double speed = feed(operation_, path.length());
    if (start != end) add(path, false, speed);
  } else {
    bool whole = true;
    for (std::size_t i = 0; i < 3; ++i) whole = whole && position_[i] && to[i];
    if (whole || compensation_.active()) rapidTo(known(to, operation_));
  }
  position_ = to;
}

void Interpreter::arc(Block& block, const Position& to) {
  const Point start = known(position_, operation_), end = known(to, operation_);
  const bool clockwise = motion_ == 2;
  const Word* radius = block.take('R');
  const auto [a, b, c] = nc::axesOf(plane_);
  PathSegment path(start);
  try {
    if (radius) {
      path = arcByRadius(start, end, length(*radius->value), clockwise, plane_);
    } else {
      const Word* first = block.take(static_cast<char>('I' + a));
      const Word* second = block.take(static_cast<char>('I' + b));
      if (!first && !second)
        throw Error(operation_ + " without a centre, expected R or I, J, K of its plane");
      CentreOffset offset;
      if (first) offset.first = length(*first->value);
      if (second) offset.second = length(*second->value);
      path = arcByCentre(start, end, offset, clockwise, plane_);
    }
  } catch (const Error& error) {
    fail(error.what());
  }
  add(path, false, feed(operation_, path.length()));
}

void Interpreter::cycle(Block& block) {
  if (plane_ != nc::Plane::xy) fail(operation_ + " in G18 or G19, expected G17");
  if (compensation_.active()) fail(operation_ + " under radius compensation, expected G40 before it");
  if (motion_ == 87) fail("G87: back boring leaves an undercut, which the stock cannot have");
  if (feed_mode_ == FeedMode::inverse_time) fail(operation_ + " in G93, expected G94 or G95");
  const Word* retract = block.take('R');
  const Word* bottom = block.take('Z');
  const Word* peck = block.take('Q');
  const Word* wait = block.take('P');
  const Word* repeat = block.take('K');
  if (!repeat) repeat = block.take('L');
  if (!in_cycle_) {
    if (!retract || !bottom) fail(operation_ + " without " + (retract ? "Z" : "R") + ", expected R and Z");
    if (pecks() && !peck) fail(operation_ + " without Q, expected the depth of a peck");
    cycle_ = {};
    cycle_.initial = known({0.0, 0.0, position_[2]}, operation_)[2];
    in_cycle_ = true;
  }
  if (retract)
    cycle_.retract =
        relative_ ? cycle_.initial + length(*retract->value) : length(*retract->value) + offset_[2];
  if (bottom)
    cycle_.bottom = relative_ ? cycle_.retract + length(*bottom->value) : length(*bottom->value) + offset_[2];
  if (peck && pecks()) {
    cycle_.peck = std::abs(length(*peck->value));
    if (!(cycle_.peck > 0.0)) refuse(*peck, peck->text() + ", expected a depth above 0");
  }
  if (wait) cycle_.dwell = secondsOf(*wait);
  if (!(cycle_.bottom < cycle_.retract)) fail(operation_ + " with Z at or above R, expected Z below R");
  const int holes = repeat ? nc::integer(*repeat, MAX_HOLES) : 1;
  for (int i = 0; i < holes; ++i) {
    Position to = position_;
    if (i == 0 || relative_) {
      Block again = block;  // X and Y of G91 count once for each hole
      to = target(again, false);
      block.take('X');
      block.take('Y');
    }
    // Before the first hole the tool may be below the retract plane (LinuxCNC raises it first).
    if (*position_[2] < cycle_.retract) {
      Position up = position_;
      up[2] = cycle_.retract;
      rapidTo(known(up, operation_));
      to[2] = cycle_.retract;
    }
    if (position_[0] && position_[1]) {
      rapidTo(known(to, operation_));
    } else {
      position_ = to;
    }
    drill(known(position_, operation_),
          to_retract_plane_ ? cycle_.retract : std::max(cycle_.initial, cycle_.retract));
  }
}

void Interpreter::drill(const Point& hole, double retract) {
  const double speed = feed(operation_, 0.0);
  const auto at = [&](double z) { return Point{hole[0], hole[1], z}; };
  rapidTo(at(cycle_.retract));
  const auto feedTo = [&](double z, double dwell) {
    add(PathSegment::line(known(position_, operation_), at(z)), false, speed, dwell);
    position_[2] = z;
  };
  if (pecks() && (cycle_.retract - cycle_.bottom) / cycle_.peck > MAX_PECKS)
    fail(operation_ + formatted(" with more than %.0f pecks", MAX_PECKS));
  if (pecks()) {
    for (double depth = cycle_.retract - cycle_.peck; depth > cycle_.bottom + 1e-9; depth -= cycle_.peck) {
      feedTo(depth, 0.0);
      if (motion_ == 83) rapidTo(at(cycle_.retract));  // G73 breaks the chip only
      rapidTo(at(std::min(cycle_.retract, depth + PECK_CLEARANCE)));
    }
  }
  const bool taps = motion_ == 74 || motion_ == 84;
  const bool waits = taps || motion_ == 76 || motion_ == 82 || motion_ == 88 || motion_ == 89;
  feedTo(cycle_.bottom, waits ? cycle_.dwell : 0.0);
  // Tapping and boring with a feed on the way out; G76, G86 and G88 leave with the spindle at rest.
  if (taps || motion_ == 85 || motion_ == 89) feedTo(cycle_.retract, 0.0);
  rapidTo(at(retract));
}

}  // namespace smartmill::program
