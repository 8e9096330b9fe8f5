#include "smartmill_cnc/linuxcnc/protocol.h"

#include <cmath>
#include <cstring>
#include <type_traits>
#include <utility>

#include "smartmill_core/error.h"

namespace smartmill::cnc::linuxcnc {
namespace {

static_assert(sizeof(double) == 8, "doubles are sent as eight bytes");

/// Longest payload of each kind; kinds are numbered from 1 in the order of Message.
constexpr std::size_t SAMPLE = 10 * sizeof(double);  // [byte]
constexpr std::array<std::size_t, std::variant_size_v<Message>> LONGEST{
    LONGEST_PROGRAM + 32, LONGEST_TEXT + 32, 0, LONGEST_TEXT + 256, 16 + ServoBlock::MOST* SAMPLE, 8, 16};

class Packer {
 public:
  template <class Number>
  void number(Number value) {
    std::uint64_t bits = 0;
    if constexpr (std::is_floating_point_v<Number>) {
      std::memcpy(&bits, &value, sizeof value);
    } else {
      bits = static_cast<std::uint64_t>(value);
    }
    for (std::size_t i = 0; i < sizeof value; ++i) {
      bytes += static_cast<char>(bits >> (8 * i) & 0xff);
    }
  }
  void text(const std::string& value, std::size_t longest) {
    const std::size_t size = std::min(value.size(), longest);
    number(static_cast<std::uint32_t>(size));
    bytes.append(value, 0, size);
  }
  template <class Numbers>
  void numbers(const Numbers& values) {
    for (const double value : values) {
      number(value);
    }
  }
  std::string bytes;
};

class Unpacker {
 public:
  Unpacker(const char* data, std::size_t size) : data_(data), left_(size) {}

  template <class Number>
  Number number() {
    const char* at = take(sizeof(Number));
    std::uint64_t bits = 0;
    for (std::size_t i = 0; i < sizeof(Number); ++i) {
      bits |= static_cast<std::uint64_t>(static_cast<unsigned char>(at[i])) << (8 * i);
    }
    if constexpr (std::is_floating_point_v<Number>) {
      Number value{};
      std::memcpy(&value, &bits, sizeof value);
      return value;
    } else {
      return static_cast<Number>(bits);
    }
  }
  double finite() {
    const double value = number<double>();
    if (!std::isfinite(value)) {
      throw Error("a frame contains a number that is not finite");
    }
    return value;
  }
  bool flag() { return number<std::uint8_t>() != 0; }
  template <class Enum>
  Enum enumeration(int first, int last) {
    const int value = number<std::uint8_t>();
    if (value < first || value > last) {
      throw Error("a frame contains the unknown value " + std::to_string(value));
    }
    return static_cast<Enum>(value);
  }
  std::string text() {
    const auto size = number<std::uint32_t>();
    const char* at = take(size);
    return std::string(at, size);
  }
  void numbers(std::array<double, 3>& values) {
    for (double& value : values) {
      value = finite();
    }
  }
  void end() const {
    if (left_ != 0) {
      throw Error("a frame is " + std::to_string(left_) + " bytes too long");
    }
  }

 private:
  const char* take(std::size_t size) {
    if (size > left_) {
      throw Error("a frame is too short for its contents");
    }
    const char* at = data_;
    data_ += size;
    left_ -= size;
    return at;
  }

  const char* data_;
  std::size_t left_;
};

void pack(const Command& m, Packer& p) {
  if (m.text.size() > LONGEST_PROGRAM) {
    throw Error("a program of " + std::to_string(m.text.size()) + " bytes is longer than " +
                std::to_string(LONGEST_PROGRAM));
  }
  p.number(static_cast<std::uint8_t>(m.code));
  p.number(m.number);
  p.number(m.value);
  p.text(m.text, LONGEST_PROGRAM);
}

void unpack(Command& m, Unpacker& u) {
  m.code = u.enumeration<CommandCode>(1, 10);
  m.number = u.number<std::int32_t>();
  m.value = u.finite();
  m.text = u.text();
}

void pack(const Reply& m, Packer& p) {
  p.number(static_cast<std::uint8_t>(m.code));
  p.text(m.text, LONGEST_TEXT);
}

void unpack(Reply& m, Unpacker& u) {
  m.code = u.enumeration<Reply::Code>(0, 5);
  m.text = u.text();
}

void pack(const StatusRequest&, Packer&) {
}
void unpack(StatusRequest&, Unpacker&) {
}

void pack(const MachineStatus& m, Packer& p) {
  p.number(static_cast<std::uint8_t>(m.alive));
  p.number(static_cast<std::uint8_t>(m.state));
  p.number(static_cast<std::uint8_t>(m.mode));
  for (const bool flag : {m.busy, m.held, m.homed, m.in_position}) {
    p.number(static_cast<std::uint8_t>(flag));
  }
  p.number(m.dwell_left);
  p.number(m.line);
  p.number(m.running);
  p.number(m.done);
  p.number(m.velocity);
  p.numbers(m.position);
  p.numbers(m.distance_to_go);
  p.numbers(m.offset);
  p.number(m.heartbeat);
  p.number(m.starved);
  p.text(m.errors, LONGEST_TEXT);
}

void unpack(MachineStatus& m, Unpacker& u) {
  m.alive = u.flag();
  m.state = u.enumeration<MachineStatus::State>(1, 4);
  m.mode = u.enumeration<MachineStatus::Mode>(1, 3);
  for (bool* flag : {&m.busy, &m.held, &m.homed, &m.in_position}) {
    *flag = u.flag();
  }
  m.dwell_left = u.finite();
  m.line = u.number<std::int32_t>();
  m.running = u.number<std::int32_t>();
  m.done = u.number<std::int32_t>();
  m.velocity = u.finite();
  u.numbers(m.position);
  u.numbers(m.distance_to_go);
  u.numbers(m.offset);
  m.heartbeat = u.number<std::uint32_t>();
  m.starved = u.finite();
  m.errors = u.text();
}

void pack(const ServoBlock& m, Packer& p) {
  if (m.samples.size() > ServoBlock::MOST) {
    throw Error("a block of " + std::to_string(m.samples.size()) + " servo samples: expected at most " +
                std::to_string(ServoBlock::MOST));
  }
  p.number(m.first);
  p.number(m.period_ns);
  p.number(static_cast<std::uint32_t>(m.samples.size()));
  for (const ServoSample& s : m.samples) {
    p.numbers(s.position);
    p.numbers(std::array<double, 7>{s.revolutions, s.spindle_speed, s.velocity, s.distance_to_go,
                                    s.spindle_load, s.marker, s.tool});
  }
}

void unpack(ServoBlock& m, Unpacker& u) {
  m.first = u.number<std::uint32_t>();
  m.period_ns = u.number<std::uint32_t>();
  const auto count = u.number<std::uint32_t>();
  if (count > ServoBlock::MOST || m.period_ns == 0) {
    throw Error("a block of " + std::to_string(count) + " servo samples, " + std::to_string(m.period_ns) +
                " ns apart: expected at most " + std::to_string(ServoBlock::MOST) + " and a period above 0");
  }
  m.samples.resize(count);
  for (ServoSample& s : m.samples) {
    u.numbers(s.position);
    for (double* value : {&s.revolutions, &s.spindle_speed, &s.velocity, &s.distance_to_go, &s.spindle_load,
                          &s.marker, &s.tool}) {
      *value = u.finite();
    }
  }
}

void pack(const SetLoad& m, Packer& p) {
  p.number(m.spindle_load);
}

void unpack(SetLoad& m, Unpacker& u) {
  m.spindle_load = u.finite();
}

void pack(const SetOverrides& m, Packer& p) {
  p.number(m.feed);
  p.number(m.spindle);
}

void unpack(SetOverrides& m, Unpacker& u) {
  m.feed = u.finite();
  m.spindle = u.finite();
}

/// Unpacks the message of a kind. @param index in Message
template <std::size_t INDEX = 0>
Message messageOf(std::size_t index, Unpacker& unpacker) {
  if constexpr (INDEX < std::variant_size_v<Message>) {
    if (index != INDEX) {
      return messageOf<INDEX + 1>(index, unpacker);
    }
    std::variant_alternative_t<INDEX, Message> message;
    unpack(message, unpacker);
    unpacker.end();
    return message;
  } else {
    throw Error("a frame of the unknown kind " + std::to_string(index + 1));
  }
}

}  // namespace

std::string encode(const Message& message, std::uint16_t sequence) {
  Packer payload;
  std::visit([&](const auto& m) { pack(m, payload); }, message);
  Packer frame;
  frame.number(static_cast<std::uint32_t>(payload.bytes.size()));
  frame.number(PROTOCOL_VERSION);
  frame.number(static_cast<std::uint8_t>(message.index() + 1));
  frame.number(sequence);
  return frame.bytes + payload.bytes;
}

void FrameDecoder::push(const char* data, std::size_t size) {
  bytes_.erase(0, std::exchange(taken_, 0));
  bytes_.append(data, size);
}

std::optional<Received> FrameDecoder::next() {
  if (waiting() < FRAME_HEADER) {
    return std::nullopt;
  }
  Unpacker header(bytes_.data() + taken_, FRAME_HEADER);
  const auto length = header.number<std::uint32_t>();
  const auto version = header.number<std::uint8_t>();
  const std::size_t kind = header.number<std::uint8_t>();
  Received received;
  received.sequence = header.number<std::uint16_t>();
  if (version != PROTOCOL_VERSION) {
    throw Error("a frame of version " + std::to_string(version) + ", expected " +
                std::to_string(PROTOCOL_VERSION));
  }
  if (kind < 1 || kind > LONGEST.size()) {
    throw Error("a frame of the unknown kind " + std::to_string(kind));
  }
  if (length > LONGEST[kind - 1]) {
    throw Error("a frame of kind " + std::to_string(kind) + " and " + std::to_string(length) +
                " bytes, at most " + std::to_string(LONGEST[kind - 1]));
  }
  if (waiting() < FRAME_HEADER + length) {
    return std::nullopt;
  }
  Unpacker payload(bytes_.data() + taken_ + FRAME_HEADER, length);
  taken_ += FRAME_HEADER + length;
  received.message = messageOf(kind - 1, payload);
  return received;
}

}  // namespace smartmill::cnc::linuxcnc
