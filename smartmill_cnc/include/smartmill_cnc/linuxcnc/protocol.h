#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <variant>
#include <vector>

/// What linuxcnc_gateway and linuxcnc_stream say on their local sockets. A frame is a header of eight bytes
/// (length of the payload u32, version u8, kind u8, sequence u16; little-endian) and a payload of a typed
/// message, whose length has a bound of its kind. What does not fit throws Error; its connection then is
/// closed.
namespace smartmill::cnc::linuxcnc {

constexpr std::uint8_t PROTOCOL_VERSION = 2;
constexpr std::size_t FRAME_HEADER = 8;           ///< [byte]
constexpr std::size_t LONGEST_PROGRAM = 1 << 20;  ///< [byte]
constexpr std::size_t LONGEST_TEXT = 4096;        ///< [byte] of any other text

enum class Word : std::uint8_t {
  ready = 1,     ///< the panel's: emergency stop reset, drives on, homed
  open = 2,      ///< to where programs come in from outside (MDI)
  run = 3,       ///< text is a program, number its own, counted up by whoever sends it
  close = 4,     ///< what open() began ends; the spindle stops
  abort = 5,     ///< axes and spindle stop, the program is forgotten
  estop = 6,     ///< emergency stop
  hold = 7,      ///< feed hold
  resume = 8,    ///< from feed hold
  variable = 9,  ///< #number = value
  guard = 10     ///< from linuxcnc_stream: when it goes or falls silent, emergency stop
};

/// To the gateway; every one is answered by a Reply with the same sequence number.
struct Command {
  Word word = Word::abort;
  std::int32_t number = 0;
  double value = 0.0;
  std::string text;
};

struct Reply {
  enum class Code : std::uint8_t {
    done = 0,
    refused = 1,
    emergency = 2,
    wrong_mode = 3,
    not_yet = 4,
    lost = 5
  };
  Code code = Code::done;
  std::string text;  ///< one line
};

/// To the gateway; answered by a MachineStatus.
struct Ask {};

/// How LinuxCNC stands, of one moment.
struct MachineStatus {
  enum class State : std::uint8_t { emergency = 1, reset = 2, off = 3, on = 4 };
  enum class Mode : std::uint8_t { manual = 1, automatic = 2, mdi = 3 };
  bool alive = false;  ///< its task still counts its cycles; if not, what follows is the last that was seen
  State state = State::emergency;
  Mode mode = Mode::manual;
  bool busy = false;  ///< a program runs or waits
  bool held = false;  ///< feed hold
  bool homed = false;
  bool in_position = true;                 ///< no axis is on its way
  double dwell_left = 0.0;                 ///< [s]
  std::int32_t line = 0;                   ///< of the program that motion is at
  std::int32_t running = 0;                ///< number of the program taken last
  std::int32_t done = 0;                   ///< number of the program carried out last, to its end
  double velocity = 0.0;                   ///< [m/s] along the path
  std::array<double, 3> position{};        ///< [m] machine
  std::array<double, 3> distance_to_go{};  ///< [m]
  std::array<double, 3> offset{};          ///< [m] machine minus workpiece coordinates
  std::uint32_t heartbeat = 0;             ///< servo cycles that the task has seen
  double starved = 0.0;  ///< [s] that it has not counted for want of a processor; 0 once it counts again
  std::string errors;    ///< since a program or ready was asked for last, joined by "; "; why it is not alive
};

/// What the stream reads at every servo cycle, in this order, and its units.
struct ServoSample {
  std::array<double, 3> position{};  ///< [m] machine, commanded
  double revolutions = 0.0;          ///< [1] of the spindle, tooth 1 at +y at every whole one
  double spindle_speed = 0.0;        ///< [rad/s]
  double velocity = 0.0;             ///< [m/s] along the path
  double distance_to_go = 0.0;       ///< [m] of the move
  double spindle_load = 0.0;         ///< [1] of full scale, what the drive or its stand-in tells
  double marker = 0.0;               ///< of the program's move (M67 E0)
};

/// From the stream, without being asked: samples first, first + 1 ... of the controller's own count.
struct ServoBlock {
  std::uint32_t first = 0;
  std::uint32_t period_ns = 1000000;
  std::vector<ServoSample> samples;
  static constexpr std::size_t MOST = 250;  ///< samples a block
};

/// To the stream: the spindle load that a stand-in for the drive tells. Answered by nothing.
struct SetLoad {
  double spindle_load = 0.0;  ///< [1]
};

/// To the stream: factors on the feed and on the spindle's speed. Answered by a Reply with the same sequence
/// number.
struct SetOverrides {
  double feed = 1.0, spindle = 1.0;  ///< [1] >= 0
};

using Message = std::variant<Command, Reply, Ask, MachineStatus, ServoBlock, SetLoad, SetOverrides>;

struct Received {
  std::uint16_t sequence = 0;
  Message message;
};

/// @return the frame. @throws Error when the message has more than a frame may hold.
std::string encode(const Message& message, std::uint16_t sequence = 0);

/// Frames from bytes as they come, in any pieces.
class FrameDecoder {
 public:
  void push(const char* data, std::size_t size);
  /// The next whole message; nothing when more bytes are due. @throws Error of one line on what is no frame;
  /// nothing sensible comes after that.
  std::optional<Received> next();
  std::size_t waiting() const { return bytes_.size() - taken_; }  ///< [byte]

 private:
  std::string bytes_;
  std::size_t taken_ = 0;
};

}  // namespace smartmill::cnc::linuxcnc
