#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

/// The FOCAS2 Ethernet protocol (TCP 8193): frames, sub-packets and numbers, without sockets. All integers on
/// the wire are big-endian. Decoding does not read beyond its input; data that do not fit throw WireError.
namespace smartmill::focas {

using Bytes = std::vector<std::uint8_t>;

/// Return codes of the FOCAS library, as on the wire.
enum EwCode : std::int16_t {
  EW_PROTOCOL = -17,
  EW_SOCKET = -16,
  EW_BUS = -11,
  EW_SYSTEM2 = -10,
  EW_HSSB = -9,
  EW_HANDLE = -8,
  EW_VERSION = -7,
  EW_UNEXP = -6,
  EW_SYSTEM = -5,
  EW_PARITY = -4,
  EW_MMCSYS = -3,
  EW_RESET = -2,
  EW_BUSY = -1,
  EW_OK = 0,
  EW_FUNC = 1,
  EW_LENGTH = 2,
  EW_NUMBER = 3,
  EW_ATTRIB = 4,
  EW_DATA = 5,
  EW_NOOPT = 6,
  EW_PROT = 7,
  EW_OVRFLOW = 8,
  EW_PARAM = 9,
  EW_BUFFER = 10,
  EW_PATH = 11,
  EW_MODE = 12,
  EW_REJECT = 13,
  EW_DTSRVR = 14,
  EW_ALARM = 15,
  EW_STOP = 16,
  EW_PASSWD = 17,
  EW_PMC = 18,
};

/// Name of a code, e.g. "EW_MODE"; "code 42" for an unnamed one.
std::string ewName(int code);

/// Result of a DNC session (cnc_dncend2).
enum DncResult : std::int16_t {
  DNC_NORMAL = -1,
  DNC_OPENERR = -514,
  DNC_NOFILE = -516,
  DNC_READERR = -517,
  DNC_CANCEL = -32768,
};

/// Automatic mode and run state, as in statinfo.
enum Aut : std::int16_t {
  AUT_MDI = 0,
  AUT_MEM = 1,
  AUT_EDIT = 3,
  AUT_HANDLE = 4,
  AUT_JOG = 5,
  AUT_INC = 8,
  AUT_REF = 9,
  AUT_REMOTE = 10
};
enum Run : std::int16_t { RUN_RESET = 0, RUN_STOP = 1, RUN_HOLD = 2, RUN_START = 3 };
enum MotionState : std::int16_t { MOTION_NONE = 0, MOTION_MOVES = 1, MOTION_DWELL = 2 };

constexpr std::uint16_t DEFAULT_PORT = 8193;
constexpr std::size_t HEADER_SIZE = 10;          ///< [byte] of a frame
constexpr std::size_t MAX_BODY = 65535;          ///< [byte] of a frame
constexpr std::size_t DNC_CHUNK = 1450;          ///< [byte] maximum text in one DNC frame of a client
constexpr std::size_t STREAM_NAME_BODY = 0x204;  ///< [byte] body of a stream's start
constexpr std::uint16_t REQUEST_VERSION = 1;     ///< of every request
constexpr std::uint16_t REPLY_VERSION = 3;       ///< of the replies of a 30i
constexpr std::uint16_t STREAM_CIRCUIT = 1;      ///< open code: DNC and transfers
constexpr std::uint16_t DATA_CIRCUIT = 2;        ///< open code: data requests

/// Frame types (first byte of the type word).
enum FrameType : std::uint8_t {
  FRAME_OPEN = 0x01,
  FRAME_CLOSE = 0x02,
  FRAME_DOWNLOAD_START = 0x11,
  FRAME_DOWNLOAD_DATA = 0x12,
  FRAME_DOWNLOAD_END = 0x13,
  FRAME_UPLOAD_START = 0x15,
  FRAME_UPLOAD_DATA = 0x16,
  FRAME_UPLOAD_END = 0x17,
  FRAME_DNC_START = 0x19,
  FRAME_DNC_DATA = 0x1a,
  FRAME_DNC_END = 0x1b,
  FRAME_DNC_CANCEL = 0x1c,
  FRAME_DATA = 0x21,
};

/// Directions (second byte).
enum Direction : std::uint8_t { DIR_REQUEST = 1, DIR_REPLY = 2, DIR_ERROR = 3, DIR_STREAM = 4 };

/// Operation codes (c3 of a sub-packet; c1 = 1, of PMC calls 2).
enum Opcode : std::uint16_t {
  OP_START = 0x01,
  OP_RESET = 0x02,
  OP_SEARCH_PROGRAM = 0x03,
  OP_DELETE_PROGRAM = 0x05,
  OP_PROGRAM_LIST = 0x06,
  OP_PARAMETER_LEGACY = 0x0e,
  OP_READ_MACRO = 0x15,
  OP_WRITE_MACRO = 0x16,
  OP_SYSTEM_INFO = 0x18,
  OP_STATUS = 0x19,
  OP_ALARM = 0x1a,
  OP_PROGRAM_NUMBER = 0x1c,
  OP_SEQUENCE_NUMBER = 0x1d,
  OP_REWIND = 0x1f,
  OP_EXECUTING_BLOCK = 0x20,
  OP_ALARM_MESSAGES = 0x23,
  OP_ACTUAL_FEED = 0x24,
  OP_ACTUAL_SPEED = 0x25,
  OP_POSITION = 0x26,
  OP_DIAGNOSIS_LEGACY = 0x30,
  OP_BLOCK_COUNT = 0x35,
  OP_DNC_DIAGNOSIS = 0x3a,
  OP_SPINDLE = 0x40,
  OP_CLOCK = 0x45,
  OP_SET_CLOCK = 0x46,
  OP_SERVO = 0x56,
  OP_OPERATION_MODE = 0x57,
  OP_UNITS = 0x88,
  OP_AXIS_NAMES = 0x89,
  OP_SPINDLE_NAMES = 0x8a,
  OP_PARAMETER = 0x8d,
  OP_DIAGNOSIS = 0x93,
  OP_TMMODE = 0x98,
  OP_DISPLAY_FLAGS = 0xa3,
  OP_LOCK = 0xa4,
  OP_READ_MACRO_DOUBLE = 0xa7,
  OP_WRITE_MACRO_DOUBLE = 0xa8,
  OP_FOLDER = 0xb0,
  OP_FOLDER_LIST = 0xb3,
  OP_FOLDER_COUNT = 0xb4,
  OP_MAIN_PROGRAM = 0xb9,
  OP_SELECT_PROGRAM = 0xba,
  OP_EXECUTING_PROGRAM = 0xcf,
  OP_HDCK = 0xe1,
  OP_STATUS2 = 0xe2,
  OP_CNC_ID = 0xe8,
  OP_PMC_READ = 0x8001,
  OP_PMC_WRITE = 0x8002,
};

/// Kind of OP_POSITION (v1). The first four are those of rdposition, the others of the single calls.
enum PositionKind : std::int32_t {
  RDPOSITION_ABSOLUTE = 0,
  POSITION_MACHINE = 1,
  RDPOSITION_RELATIVE = 2,
  RDPOSITION_DISTANCE = 3,
  POSITION_ABSOLUTE = 4,
  POSITION_RELATIVE = 6,
  POSITION_DISTANCE = 7,
  POSITION_SKIP = 8,
  POSITION_SERVO_DELAY = 9,
  POSITION_ACCELERATION_DELAY = 10,
};

/// Kind of OP_SPINDLE (v1).
enum SpindleKind : std::int32_t {
  SPINDLE_LOAD = 0,
  SPINDLE_MAX_SPEED = 1,
  SPINDLE_GEAR = 2,
  SPINDLE_SPEED = 3,
  SPINDLE_METER_LOAD = 4,
  SPINDLE_METER_SPEED = 5,
};

/// Bytes that are no FOCAS data, or a reply that does not match its request; what() is one line.
class WireError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// value / base^exp; exp -1: vacant.
struct Value8 {
  std::int32_t value = 0;
  std::uint16_t base = 10;
  std::int16_t exp = 0;

  bool vacant() const { return exp == -1; }
  /// NaN when vacant.
  double toDouble() const;
  static Value8 vacantValue() { return {0, 10, -1}; }
  /// Rounded to a number of decimals (0..9); a value beyond 32 bit saturates, NaN is vacant.
  static Value8 fromDouble(double value, int decimals);
  /// Nine significant digits without trailing zeros, as the controller displays a macro variable.
  static Value8 fromMacro(std::optional<double> value);
};

/// Appends big-endian numbers.
class Writer {
 public:
  Writer& u8(std::uint8_t value);
  Writer& u16(std::uint16_t value);
  Writer& i16(std::int16_t value) { return u16(static_cast<std::uint16_t>(value)); }
  Writer& u32(std::uint32_t value);
  Writer& i32(std::int32_t value) { return u32(static_cast<std::uint32_t>(value)); }
  Writer& f64(double value);
  Writer& value8(const Value8& value);
  Writer& zeros(std::size_t count);
  Writer& bytes(const Bytes& data);
  /// Exactly width bytes, truncated or padded.
  Writer& text(std::string_view text, std::size_t width, char fill = '\0');
  const Bytes& data() const { return data_; }

 private:
  Bytes data_;
};

/// Reads big-endian numbers. @throws WireError at the end of the data.
class Reader {
 public:
  Reader(const std::uint8_t* data, std::size_t size) : data_(data), size_(size) {}
  explicit Reader(const Bytes& data) : Reader(data.data(), data.size()) {}
  std::uint8_t u8();
  std::uint16_t u16();
  std::int16_t i16() { return static_cast<std::int16_t>(u16()); }
  std::uint32_t u32();
  std::int32_t i32() { return static_cast<std::int32_t>(u32()); }
  double f64();
  Value8 value8();
  Bytes bytes(std::size_t count);
  /// Up to the first zero byte, at most width; always consumes width.
  std::string text(std::size_t width);
  /// As text(), with '?' for characters that are not printable.
  std::string line(std::size_t width);
  Reader& skip(std::size_t count);
  std::size_t remaining() const { return size_ - position_; }

 private:
  const std::uint8_t* take(std::size_t count);
  const std::uint8_t* data_;
  std::size_t size_;
  std::size_t position_ = 0;
};

struct Frame {
  std::uint16_t version = REQUEST_VERSION;
  std::uint8_t type = 0;
  std::uint8_t direction = 0;
  Bytes body;

  bool is(FrameType t, Direction d) const { return type == t && direction == d; }
};

/// @throws WireError if the body is longer than MAX_BODY.
Bytes encodeFrame(std::uint8_t type, std::uint8_t direction, const Bytes& body, std::uint16_t version);

/// Assembles frames from chunks of any size.
class FrameReader {
 public:
  void append(const std::uint8_t* data, std::size_t size);
  /// The next complete frame; empty: none yet. @throws WireError if the bytes are no frame (wrong magic
  /// number).
  std::optional<Frame> next();
  std::size_t buffered() const { return buffer_.size() - start_; }  ///< [byte]

 private:
  Bytes buffer_;
  std::size_t start_ = 0;
};

/// Body of a frame with DIR_ERROR.
struct ErrorBody {
  std::int16_t location = 0;
  std::int16_t code = 0;
  std::int16_t detail1 = 0;
  std::int16_t detail2 = 0;
};
Bytes encodeErrorBody(const ErrorBody& error);
/// Missing bytes are zero; code EW_PROTOCOL if the code is missing.
ErrorBody decodeErrorBody(const Bytes& body);

/// One request of a data PDU.
struct SubRequest {
  std::uint16_t c1 = 1;  ///< 1 CNC, 2 PMC
  std::uint16_t c2 = 1;  ///< path
  std::uint16_t c3 = 0;  ///< Opcode
  std::array<std::int32_t, 4> v{{0, 0, 0, 0}};
  Bytes extra;  ///< v5 is its length

  SubRequest() = default;
  explicit SubRequest(std::uint16_t opcode, std::int32_t v1 = 0, std::int32_t v2 = 0, std::int32_t v3 = 0,
                      std::int32_t v4 = 0, Bytes extra_bytes = {})
      : c3(opcode), v{{v1, v2, v3, v4}}, extra(std::move(extra_bytes)) {}
};

/// One reply of a data PDU; data are empty if code is not EW_OK.
struct SubReply {
  std::uint16_t c1 = 1, c2 = 1, c3 = 0;
  std::int16_t code = EW_OK;
  std::int16_t detail = 0;
  Bytes data;
};

/// Bodies of FRAME_DATA. @throws WireError if they exceed a frame (encode) or are malformed (decode).
Bytes encodeRequests(const std::vector<SubRequest>& requests);
std::vector<SubRequest> decodeRequests(const Bytes& body);
Bytes encodeReplies(const std::vector<SubReply>& replies);
std::vector<SubReply> decodeReplies(const Bytes& body);

/// Reply to an open (version >= 3): 40 + 32 N bytes.
struct OpenReply {
  int axes = 3;  ///< controlled axes
  int spindles = 1;
  int paths = 1;
  bool spindle_meter = true;  ///< cnc_rdspmeter is available
  bool extended = true;       ///< rddynamic2, rdexecprog and others are available
};
Bytes encodeOpenReply(const OpenReply& reply);
/// Any length: missing values keep their defaults, so that a short or legacy reply is usable.
OpenReply decodeOpenReply(const Bytes& body);

}  // namespace smartmill::focas
