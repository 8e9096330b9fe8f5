#pragma once

#include <cstddef>
#include <memory>
#include <string>

#include "smartmill_core/nc/path_segment.h"

namespace smartmill::program {

enum class FeedMode { inverse_time, per_minute, per_revolution };  ///< G93, G94, G95

/// The F word in force.
struct FeedWord {
  double value = 0.0;  ///< as written, in units of the program
  double unit = 0.0;   ///< [m/s] of one
  FeedMode mode = FeedMode::per_minute;
  int line = 0;           ///< that states it, from 1
  std::size_t block = 0;  ///< executed block that states it
};

/// A motion of the tool tip, or a dwell, with the modal state in which it is executed. Coordinates are those
/// of the workpiece, z along the tool axis.
struct Move {
  std::size_t block = 0;  ///< executed block, from 0; the blocks of a subprogram count at each call
  int line = 0;           ///< in the file, from 1
  int sequence = 0;       ///< last N word until the block, which a control displays; 0: none so far
  std::string operation;  ///< "G0" ... "G3", "G81" ..., "G4"
  /// Last comment in a line of its own before the block, as the name of what follows; nullptr: none so far.
  std::shared_ptr<const std::string> name;
  nc::PathSegment path{nc::PathSegment::Point{{0, 0, 0}}};
  bool rapid = false;
  double feed = 0.0;           ///< [m/s] along the path; unused where rapid
  FeedWord feed_word;          ///< of a feed motion
  double dwell = 0.0;          ///< [s] after the motion
  double spindle_speed = 0.0;  ///< [rad/s] >= 0
  int speed_line = 0;          ///< that states the S word in force; 0: none
  bool left_hand = false;      ///< M4: the teeth move counterclockwise
  int tool = 0;                ///< T; 0: the program has not changed the tool
};

}  // namespace smartmill::program
