#pragma once

#include <array>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "block.h"
#include "cutter_compensation.h"
#include "smartmill_program/nc/program_reader.h"

namespace smartmill::program {

/// Modal state of a control; turns blocks into moves. The order of execution within a block is that of the
/// NIST RS274/NGC interpreter (table 8), which LinuxCNC and Fanuc share for these words: feed, speed, tool,
/// spindle, dwell, plane, units, offsets, distance mode, motion.
class Interpreter {
 public:
  Interpreter(const ReaderOptions& options, std::vector<Move>& moves)
      : options_(options), moves_(moves), compensation_(moves) {}

  /// Executes a block, except M98 and M99. @param number of executed blocks before it
  /// @throws Error "column C: ..."
  void execute(Block& block, std::size_t number, int line);
  bool ended() const { return ended_; }  ///< by M2 or M30
  /// Of the following blocks.
  void setName(const std::string& name) { name_ = std::make_shared<const std::string>(name); }

 private:
  using Point = nc::PathSegment::Point;
  using Position = std::array<std::optional<double>, 3>;  // [m]; nullopt: unknown

  struct Cycle {
    double retract = 0.0, bottom = 0.0;  // [m] R, Z
    double initial = 0.0;                // [m] z before the first hole
    double peck = 0.0;                   // [m] Q of G73 and G83
    double dwell = 0.0;                  // [s]
  };

  [[noreturn]] void fail(const std::string& message) const;  // at the word of the motion
  void compensated(const std::function<void()>& action) const;
  void setModes(Block& block);
  void setUnits(const nc::Word& word);
  void setWorkOffset(Block& block, const nc::Word& word);
  void setLocalOffset(Block& block, const nc::Word& code);
  void setRotation(Block& block, const nc::Word& code);
  void setTool(Block& block);
  void setCompensation(Block& block);
  void dwell(Block& block, const nc::Word& code);
  void reference(Block& block, const nc::Word& code, bool by_way);
  void motion(Block& block);
  void arc(Block& block, const Position& target);
  void cycle(Block& block);
  void drill(const Point& hole, double retract);

  bool pecks() const { return motion_ == 73 || motion_ == 83; }
  bool hasAxes(const Block& block) const { return block.has('X') || block.has('Y') || block.has('Z'); }
  double length(double value);
  Position target(Block& block, bool with_z = true);
  static double secondsOf(const nc::Word& word);
  Point known(const Position& position, const std::string& what) const;
  double feed(const std::string& operation, double path_length) const;
  nc::PathSegment rotated(const nc::PathSegment& path) const;
  void add(const nc::PathSegment& path, bool rapid, double feed, double dwell = 0.0);
  void rapidTo(const Point& point);

  const ReaderOptions& options_;
  std::vector<Move>& moves_;

  // of the block
  std::size_t number_ = 0;
  int line_ = 0;
  std::string operation_;
  std::shared_ptr<const std::string> name_;
  std::optional<nc::Word> motion_word_;

  // modal
  int sequence_ = 0;  // last N word
  Position position_;
  int motion_ = -1;  // -1: none; 80: cancelled
  nc::Plane plane_ = nc::Plane::xy;
  bool relative_ = false, to_retract_plane_ = false;
  FeedMode feed_mode_ = FeedMode::per_minute;
  std::optional<double> unit_;           // [m] of one in the program
  std::optional<std::string> work_;      // "G54"
  Point offset_{{0, 0, 0}};              // [m] of work_ with the local offset of G52
  Point local_{{0, 0, 0}};               // [m] G52
  double rotation_ = 0.0;                // [rad] G68, of the coordinates in which position_ is stated
  std::array<double, 2> about_{{0, 0}};  // [m] its centre
  std::optional<double> feed_;           // [m/min], [m/rev] or [1/min]
  FeedWord feed_word_;                   // of feed_; without its unit
  double speed_ = 0.0;                   // [rad/s]
  int speed_line_ = 0;                   // that states it
  int turns_ = 0;                        // 3 M3, 4 M4, 0 at rest
  int selected_tool_ = 0, tool_ = 0;
  CutterCompensation compensation_;
  std::optional<int> radius_offset_;  // D
  Cycle cycle_;
  bool in_cycle_ = false;
  bool ended_ = false;
};

}  // namespace smartmill::program
