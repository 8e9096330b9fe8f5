#include "smartmill_program/nc/linuxcnc_program.h"

#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <cctype>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <filesystem>
#include <optional>
#include <set>
#include <sstream>

#include "smartmill_core/error.h"
#include "smartmill_core/formatted.h"
#include "smartmill_core/io/text_file.h"
#include "smartmill_core/units.h"

namespace smartmill::program {
namespace {

using nc::PathSegment;
using units::MM;
using Point = PathSegment::Point;

constexpr int MOST_LINES = 99999;   // N of LinuxCNC
constexpr int MOST_TOOL = 999;      // of the tool table
constexpr double INCH = 25.4 * MM;  // unit of the tool table and the parameter file
constexpr double FAR = 1000.0;      // [inch] of the machine's zero above that of the work
constexpr double CLOSED = 1e-3;     // [1] by which a number of turns differs from the end of an arc
constexpr const char* OFFSETS[] = {"G54", "G55", "G56", "G57", "G58", "G59", "G59.1", "G59.2", "G59.3"};

/// A folder for the files of rs274, removed with its object.
class Folder {
 public:
  Folder() : name_((std::filesystem::temp_directory_path() / "smartmill_rs274_XXXXXX").string()) {
    if (!mkdtemp(name_.data())) throw Error(name_ + ": cannot be created");
  }
  Folder(const Folder&) = delete;
  Folder& operator=(const Folder&) = delete;
  ~Folder() {
    std::error_code ignored;
    std::filesystem::remove_all(name_, ignored);
  }
  std::string file(const char* name) const { return name_ + "/" + name; }

 private:
  std::string name_;
};

/// The program with the number of each line as its N word, by which the interpreter names its commands. Lines
/// with an O word have none.
std::string numbered(const std::string& text, const std::string& name) {
  std::istringstream lines(text);
  std::ostringstream out;
  int number = 0;
  for (std::string line; std::getline(lines, line);) {
    if (++number > MOST_LINES)
      throw Error(name + ": more than " + std::to_string(MOST_LINES) +
                  " lines, the most that LinuxCNC numbers");
    std::size_t at = line.find_first_not_of(" \t\r");
    const bool deleted = at != std::string::npos && line[at] == '/';
    if (deleted) at = line.find_first_not_of(" \t\r", at + 1);
    if (at != std::string::npos && std::toupper(static_cast<unsigned char>(line[at])) == 'N') {
      at = line.find_first_not_of("0123456789. \t", at + 1);
      if (at == std::string::npos) at = line.size();
    }
    const std::string rest = at == std::string::npos ? "" : line.substr(at);
    const bool plain = rest.empty() || std::string("%oO(;\r").find(rest[0]) != std::string::npos;
    out << (deleted ? "/" : "") << (plain ? "" : "N" + std::to_string(number) + " ") << rest << "\n";
  }
  return out.str();
}

/// Numbers of the T words, which are outside of comments and expressions.
std::set<int> toolsIn(const std::string& text) {
  std::set<int> tools;
  int depth = 0;
  for (std::size_t k = 0; k + 1 < text.size(); ++k) {
    const char c = text[k];
    if (c == '(' || c == '[') ++depth;
    if (c == ')' || c == ']') --depth;
    if (c == '\n') depth = 0;
    const bool word =
        (c == 'T' || c == 't') && depth == 0 && std::isdigit(static_cast<unsigned char>(text[k + 1])) != 0;
    const bool within = k > 0 && std::isalpha(static_cast<unsigned char>(text[k - 1])) != 0;
    if (word && !within) tools.insert(std::atoi(text.c_str() + k + 1));
  }
  return tools;
}

/// Executes the canonical commands.
class Canon {
 public:
  Canon(const std::string& name, const ReaderOptions& options) : name_(name), options_(options) {}

  /// A line "   12 N7     COMMAND(arguments)". Others are ignored.
  void take(const std::string& text) {
    int count = 0, at = 0;
    char sequence[16] = "";
    if (std::sscanf(text.c_str(), "%d %15s %n", &count, sequence, &at) != 2 || sequence[0] != 'N') return;
    if (sequence[1] != '.') line_ = std::atoi(sequence + 1);
    const std::string rest = text.substr(static_cast<std::size_t>(at));
    const std::size_t open = rest.find('(');
    if (open != std::string::npos) execute(rest.substr(0, open), rest.substr(open + 1));
  }

  std::vector<Move> moves() { return std::move(moves_); }
  int line() const { return line_; }

 private:
  [[noreturn]] void fail(const std::string& message) const {
    throw Error(name_ + ": line " + std::to_string(line_) + ": " + message);
  }

  static std::vector<double> numbersOf(std::string arguments) {
    for (char& c : arguments)
      if (c == ',' || c == ')') c = ' ';
    std::istringstream words(arguments);
    std::vector<double> numbers;
    for (double number; words >> number;) numbers.push_back(number);
    return numbers;
  }

  void execute(const std::string& command, const std::string& arguments) {
    const std::vector<double> n = numbersOf(arguments);
    const auto at = [&](std::size_t k) { return k < n.size() ? n[k] : 0.0; };
    if (command == "USE_LENGTH_UNITS") {
      unit_ = arguments.find("INCHES") != std::string::npos ? INCH : MM;
    } else if (command == "SELECT_PLANE") {
      plane_ = arguments.find("_YZ") != std::string::npos   ? nc::Plane::yz
               : arguments.find("_XZ") != std::string::npos ? nc::Plane::zx
                                                            : nc::Plane::xy;
    } else if (command == "SET_G5X_OFFSET") {
      setWorkOffset(static_cast<int>(at(0)), {at(1), at(2), at(3)});
    } else if (command == "SET_G92_OFFSET") {
      shift_ = {at(0) * unit_, at(1) * unit_, at(2) * unit_};
    } else if (command == "SET_XY_ROTATION") {
      rotation_ = units::radFromDeg(at(0));
    } else if (command == "SET_FEED_RATE") {
      feed_ = at(0);
    } else if (command == "SET_FEED_MODE") {
      per_revolution_ = at(1) != 0.0;
    } else if (command == "SET_SPINDLE_SPEED") {
      speed_ = units::radPerSecFromRpm(at(1));
    } else if (command == "SET_SPINDLE_MODE") {
      if (at(1) != 0.0) fail("G96: constant surface speed is for lathes, expected G97");
    } else if (command == "START_SPINDLE_CLOCKWISE") {
      turns_ = 3;
    } else if (command == "START_SPINDLE_COUNTERCLOCKWISE") {
      turns_ = 4;
    } else if (command == "STOP_SPINDLE_TURNING") {
      turns_ = 0;
    } else if (command == "SELECT_TOOL") {
      selected_ = static_cast<int>(at(0));
    } else if (command == "CHANGE_TOOL") {
      tool_ = selected_;
    } else if (command == "STRAIGHT_TRAVERSE") {
      straight({at(0), at(1), at(2)}, {at(3), at(4), at(5)}, true);
    } else if (command == "STRAIGHT_FEED") {
      straight({at(0), at(1), at(2)}, {at(3), at(4), at(5)}, false);
    } else if (command == "ARC_FEED") {
      arc(n);
    } else if (command == "DWELL") {
      add(PathSegment(here_.value_or(Point{})), false, "G4", at(0));
    } else if (command == "STRAIGHT_PROBE" || command == "RIGID_TAP" || command == "START_SPEED_FEED_SYNCH" ||
               command == "NURBS_FEED" || command == "NURBS_G5_FEED" || command == "NURBS_G6_FEED") {
      fail(command + " of LinuxCNC has no move of a mill here");
    }
  }

  // The first report of an offset is the position of the machine's zero, which is not part of a program.
  void setWorkOffset(int number, const Point& reported) {
    if (number < 1 || number > 9)
      fail("work offset " + std::to_string(number) + " of LinuxCNC, expected 1 to 9");
    const std::string name = OFFSETS[number - 1];
    const auto stated = options_.work_offsets.find(name);
    if (stated == options_.work_offsets.end() && work_ && *work_ != name)
      fail(name + " after " + *work_ + ": its offset is unknown, expected --work-offset " + name + ":X:Y:Z");
    work_ = name;
    if (!zero_) zero_ = reported[2] * unit_;
    for (std::size_t i = 0; i < 3; ++i)
      offset_[i] = reported[i] * unit_ - (i == 2 ? *zero_ : 0.0) +
                   (stated == options_.work_offsets.end() ? 0.0 : stated->second[i]);
  }

  /// A place of the program in the coordinates of the stock.
  Point placed(Point p) const {
    for (std::size_t i = 0; i < 3; ++i) p[i] = p[i] * unit_ + shift_[i];
    const double c = std::cos(rotation_), s = std::sin(rotation_);
    return {offset_[0] + c * p[0] - s * p[1], offset_[1] + s * p[0] + c * p[1], offset_[2] + p[2]};
  }

  void straight(const Point& to, const Point& rotary, bool rapid) {
    if (rotary != Point{{0, 0, 0}}) fail("rotary axes, expected X, Y and Z only");
    const Point target = placed(to);
    const bool away = target[2] > 0.5 * FAR * INCH;  // G28, G30, G53
    if (here_ && !away && *here_ != target)
      add(PathSegment::line(*here_, target), rapid, rapid ? "G0" : "G1", 0.0);
    if (!here_ && !rapid) fail("G1 from an unknown position, expected G0 to X, Y and Z first");
    if (away) {
      here_.reset();
    } else {
      here_ = target;
    }
  }

  void arc(const std::vector<double>& n) {
    if (n.size() < 6) fail("ARC_FEED of LinuxCNC without its numbers");
    if (!here_) fail("an arc from an unknown position, expected G0 to X, Y and Z first");
    const auto [a, b, c] = nc::axesOf(plane_);
    Point to{}, middle{};
    to[a] = n[0];
    to[b] = n[1];
    to[c] = n[5];
    middle[a] = n[2];
    middle[b] = n[3];
    if (rotation_ != 0.0 && plane_ != nc::Plane::xy)
      fail("an arc in G18 or G19 in rotated coordinates, expected G17");
    Point target = placed(to);
    const Point centre = placed(middle);
    const bool clockwise = n[4] < 0.0;
    // Four decimals: a full circle ends where it begins.
    if (std::hypot(target[a] - (*here_)[a], target[b] - (*here_)[b]) < CLOSED * MM && std::abs(n[4]) >= 1.0) {
      target[a] = (*here_)[a];
      target[b] = (*here_)[b];
    }
    const int turns = static_cast<int>(std::abs(n[4]));
    const std::string operation = clockwise ? "G2" : "G3";
    const PathSegment last = PathSegment::arc(*here_, target, {centre[a], centre[b]}, clockwise, plane_);
    const double rise = target[c] - (*here_)[c];
    const double sweep = std::abs(last.sweep()) + units::TWO_PI * (turns - 1);
    for (int turn = 1; turn < turns; ++turn) {  // full turns first
      Point end = *here_;
      end[c] += rise * units::TWO_PI / sweep;
      add(PathSegment::arc(*here_, end, {centre[a], centre[b]}, clockwise, plane_), false, operation, 0.0);
      here_ = end;
    }
    add(PathSegment::arc(*here_, target, {centre[a], centre[b]}, clockwise, plane_), false, operation, 0.0);
    here_ = target;
  }

  void add(const PathSegment& path, bool rapid, const std::string& operation, double dwell) {
    if (block_line_ != line_) ++block_;
    block_line_ = line_;
    Move move;
    move.block = block_ - 1;
    move.line = line_;
    move.operation = operation;
    move.path = path;
    move.rapid = rapid;
    move.dwell = dwell;
    if (!rapid && dwell == 0.0) {
      const double unit = per_revolution_ ? unit_ * speed_ / units::TWO_PI : unit_ / 60.0;
      move.feed = feed_ * unit;
      if (!(move.feed > 0.0))
        fail(operation + " without a feed, expected F" + (per_revolution_ ? " and S" : ""));
      move.feed_word = {feed_, unit, per_revolution_ ? FeedMode::per_revolution : FeedMode::per_minute, line_,
                        move.block};
    }
    move.spindle_speed = turns_ == 0 ? 0.0 : speed_;
    move.left_hand = turns_ == 4;
    move.tool = tool_;
    moves_.push_back(move);
  }

  const std::string& name_;
  const ReaderOptions& options_;
  std::vector<Move> moves_;
  int line_ = 0, block_line_ = -1;
  std::size_t block_ = 0;

  double unit_ = MM;
  nc::Plane plane_ = nc::Plane::xy;
  std::optional<std::string> work_;
  std::optional<double> zero_;  // [m] Z of the first work offset: that of the parameter file
  Point offset_{}, shift_{};    // [m]
  double rotation_ = 0.0;       // [rad]
  double feed_ = 0.0;
  bool per_revolution_ = false;
  double speed_ = 0.0;  // [rad/s]
  int turns_ = 0, selected_ = 0, tool_ = 0;
  std::optional<Point> here_;
};

}  // namespace

std::vector<Move> interpretWithLinuxcnc(const std::string& text, const std::string& name,
                                        const ReaderOptions& options) {
  const Folder folder;
  writeText(folder.file("program.ngc"), numbered(text, name));
  std::ostringstream tools, variables;
  const std::set<int> used = toolsIn(text);
  for (int tool = 1; tool <= MOST_TOOL; ++tool) {
    const bool known = used.count(tool) > 0 && options.tool_radius;
    tools << "T" << tool << " P" << tool
          << formatted(" D%.8f Z0\n", known ? 2.0 * options.tool_radius(tool) / INCH : 0.0);
  }
  for (int offset = 0; offset < 9; ++offset) variables << 5223 + 20 * offset << " " << -FAR << "\n";
  writeText(folder.file("tool.tbl"), tools.str());
  writeText(folder.file("parameters.var"), variables.str());
  // The interpreter writes its tool table to ~/.tool.mmap, where a running LinuxCNC has its own: a HOME
  // apart.
  const std::string command = "HOME='" + folder.file("") + "' exec rs274 -g -t '" + folder.file("tool.tbl") +
                              "' -v '" + folder.file("parameters.var") + "' '" + folder.file("program.ngc") +
                              "' 2>'" + folder.file("messages") + "'";
  FILE* pipe = popen(command.c_str(), "r");
  if (!pipe) throw Error("rs274: cannot be started");
  Canon canon(name, options);
  std::exception_ptr refused;
  std::string line;
  for (int c; (c = std::fgetc(pipe)) != EOF;) {
    if (c != '\n') {
      line += static_cast<char>(c);
      continue;
    }
    try {
      if (!refused) canon.take(line);
    } catch (const Error&) {
      refused = std::current_exception();
    }
    line.clear();
  }
  const int status = pclose(pipe);
  if (refused) std::rethrow_exception(refused);
  constexpr int NOT_FOUND = 127;  // sh
  if (WIFEXITED(status) && WEXITSTATUS(status) == NOT_FOUND)
    throw Error("rs274: not found, expected LinuxCNC (package linuxcnc-uspace)");
  if (status == 0) return canon.moves();
  // "executing", the message, the line with its number.
  std::istringstream messages(readText(folder.file("messages")));
  std::string message = "the interpreter of LinuxCNC ended without a message";
  int at = canon.line();
  for (std::string words; std::getline(messages, words);) {
    if (words.empty() || words == "executing") continue;
    int number = 0;
    if (std::sscanf(words.c_str(), "N%d", &number) == 1) {
      at = number;
    } else {
      message = words;
    }
  }
  throw Error(name + ": line " + std::to_string(at) + ": " + message);
}

}  // namespace smartmill::program
