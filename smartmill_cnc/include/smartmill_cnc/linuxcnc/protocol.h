#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <variant>
#include <vector>

/// Protocol of linuxcnc_gateway and linuxcnc_stream on their local sockets. A frame is a header of eight
/// bytes (payload length u32, version u8, kind u8, sequence u16; little-endian) and the payload of a typed
/// message, whose length is bounded by its kind. Invalid frames throw Error; their connection is closed.
namespace smartmill::cnc::linuxcnc {

constexpr std::uint8_t PROTOCOL_VERSION = 3;
constexpr std::size_t FRAME_HEADER = 8;           ///< [byte]
constexpr std::size_t LONGEST_PROGRAM = 1 << 20;  ///< [byte]
constexpr std::size_t LONGEST_TEXT = 4096;        ///< [byte] of any other text

enum class CommandCode : std::uint8_t {
  ready = 1,     ///< by the panel: resets the emergency stop, switches the drives on, homes
  open = 2,      ///< switches to the mode that accepts programs (MDI)
  run = 3,       ///< runs the program in text; number identifies it, incremented by the sender
  close = 4,     ///< ends open; the spindle stops
  abort = 5,     ///< stops axes and spindle, discards the program
  estop = 6,     ///< emergency stop
  hold = 7,      ///< feed hold
  resume = 8,    ///< releases the feed hold
  variable = 9,  ///< sets #number to value
  guard = 10     ///< from linuxcnc_stream: emergency stop if its connection ends or is silent
};

/// To the gateway; answered by a Reply with the same sequence number.
struct Command {
  CommandCode code = CommandCode::abort;
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

/// Request of the status, to the gateway; answered by a MachineStatus.
struct StatusRequest {};

/// Status of LinuxCNC at one moment.
struct MachineStatus {
  enum class State : std::uint8_t { emergency = 1, reset = 2, off = 3, on = 4 };
  enum class Mode : std::uint8_t { manual = 1, automatic = 2, mdi = 3 };
  bool alive = false;  ///< its task counts cycles; otherwise the fields below are the last ones
  State state = State::emergency;
  Mode mode = Mode::manual;
  bool busy = false;  ///< a program runs or is queued
  bool held = false;  ///< feed hold
  bool homed = false;
  bool in_position = true;                 ///< no axis moves
  double dwell_left = 0.0;                 ///< [s]
  std::int32_t line = 0;                   ///< line of the program in motion
  std::int32_t running = 0;                ///< number of the last accepted program
  std::int32_t done = 0;                   ///< number of the last completed program
  double velocity = 0.0;                   ///< [m/s] along the path
  std::array<double, 3> position{};        ///< [m] machine
  std::array<double, 3> distance_to_go{};  ///< [m]
  std::array<double, 3> offset{};          ///< [m] machine minus workpiece coordinates
  std::uint32_t heartbeat = 0;             ///< servo cycles counted by the task
  double starved = 0.0;  ///< [s] without a count because it waits for a processor; 0 while it counts
  std::string errors;    ///< since the last run or ready, joined by "; "; or why it is not alive
};

/// Values of one servo cycle, in the order of the stream.
struct ServoSample {
  std::array<double, 3> position{};  ///< [m] machine, commanded
  double revolutions = 0.0;          ///< [1] of the spindle; tooth 1 is at +y at every integer
  double spindle_speed = 0.0;        ///< [rad/s]
  double velocity = 0.0;             ///< [m/s] along the path
  double distance_to_go = 0.0;       ///< [m] of the move
  double spindle_load = 0.0;         ///< [1] of full scale, from the drive or SetLoad; NaN: not known
  double marker = 0.0;               ///< line of the program's move (M67 E0)
  double tool = 0.0;                 ///< T of the tool in the spindle; 0: none
};

/// Published by the stream: samples first, first + 1, ... of the controller's count.
struct ServoBlock {
  std::uint32_t first = 0;
  std::uint32_t period_ns = 1000000;
  std::vector<ServoSample> samples;
  static constexpr std::size_t MOST = 250;  ///< samples per block
};

/// To the stream: spindle load of an external load meter, in place of the drive's. Not answered.
struct SetLoad {
  double spindle_load = 0.0;  ///< [1]
};

/// To the stream: factors on feed and spindle speed. Answered by a Reply with the same sequence number.
struct SetOverrides {
  double feed = 1.0, spindle = 1.0;  ///< [1] >= 0
};

using Message = std::variant<Command, Reply, StatusRequest, MachineStatus, ServoBlock, SetLoad, SetOverrides>;

struct Received {
  std::uint16_t sequence = 0;
  Message message;
};

/// @return the frame. @throws Error if the message is too long for its kind.
std::string encode(const Message& message, std::uint16_t sequence = 0);

/// Decodes frames from a byte stream received in arbitrary pieces.
class FrameDecoder {
 public:
  void push(const char* data, std::size_t size);
  /// The next complete message; empty if more bytes are needed. @throws Error (one line) on an invalid frame;
  /// the stream is unusable then.
  std::optional<Received> next();
  std::size_t waiting() const { return bytes_.size() - taken_; }  ///< [byte]

 private:
  std::string bytes_;
  std::size_t taken_ = 0;
};

}  // namespace smartmill::cnc::linuxcnc
