#include "smartmill_focas/codec.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <map>

namespace smartmill::focas {
namespace {

constexpr std::size_t SUB_REQUEST_SIZE = 0x1c;
constexpr std::size_t SUB_REPLY_SIZE = 0x10;
constexpr std::size_t OPEN_REPLY_FIXED = 40;
constexpr std::size_t OPEN_REPLY_PATH = 32;

void appendTo(Bytes& target, const Bytes& data) {
  // Resize and copy, since insert() at the end of an empty vector causes a false -Wstringop-overflow of GCC.
  const std::size_t start = target.size();
  target.resize(start + data.size());
  std::copy(data.begin(), data.end(), target.begin() + static_cast<std::ptrdiff_t>(start));
}

}  // namespace

std::string ewName(int code) {
  static const std::map<int, const char*> NAMES{
      {EW_PROTOCOL, "EW_PROTOCOL"}, {EW_SOCKET, "EW_SOCKET"}, {EW_BUS, "EW_BUS"},
      {EW_SYSTEM2, "EW_SYSTEM2"},   {EW_HSSB, "EW_HSSB"},     {EW_HANDLE, "EW_HANDLE"},
      {EW_VERSION, "EW_VERSION"},   {EW_UNEXP, "EW_UNEXP"},   {EW_SYSTEM, "EW_SYSTEM"},
      {EW_PARITY, "EW_PARITY"},     {EW_MMCSYS, "EW_MMCSYS"}, {EW_RESET, "EW_RESET"},
      {EW_BUSY, "EW_BUSY"},         {EW_OK, "EW_OK"},         {EW_FUNC, "EW_FUNC"},
      {EW_LENGTH, "EW_LENGTH"},     {EW_NUMBER, "EW_NUMBER"}, {EW_ATTRIB, "EW_ATTRIB"},
      {EW_DATA, "EW_DATA"},         {EW_NOOPT, "EW_NOOPT"},   {EW_PROT, "EW_PROT"},
      {EW_OVRFLOW, "EW_OVRFLOW"},   {EW_PARAM, "EW_PARAM"},   {EW_BUFFER, "EW_BUFFER"},
      {EW_PATH, "EW_PATH"},         {EW_MODE, "EW_MODE"},     {EW_REJECT, "EW_REJECT"},
      {EW_DTSRVR, "EW_DTSRVR"},     {EW_ALARM, "EW_ALARM"},   {EW_STOP, "EW_STOP"},
      {EW_PASSWD, "EW_PASSWD"},     {EW_PMC, "EW_PMC"},
  };
  const auto found = NAMES.find(code);
  return found != NAMES.end() ? found->second : "code " + std::to_string(code);
}

double Value8::toDouble() const {
  if (vacant()) {
    return std::numeric_limits<double>::quiet_NaN();
  }
  // base^exp is exact for every exponent in use, so that one correctly rounded division is the best double.
  return static_cast<double>(value) / std::pow(static_cast<double>(base == 0 ? 10 : base), exp);
}

Value8 Value8::fromDouble(double value, int decimals) {
  if (!std::isfinite(value)) {
    return vacantValue();
  }
  decimals = std::clamp(decimals, 0, 9);
  const double scaled = std::round(value * std::pow(10.0, decimals));
  constexpr double LARGEST = std::numeric_limits<std::int32_t>::max();
  return {static_cast<std::int32_t>(std::clamp(scaled, -LARGEST, LARGEST)), 10,
          static_cast<std::int16_t>(decimals)};
}

Value8 Value8::fromMacro(std::optional<double> value) {
  if (!value || !std::isfinite(*value)) {
    return vacantValue();
  }
  int decimals = 9;
  while (decimals > 0 && std::abs(*value) * std::pow(10.0, decimals) >= 999999999.5) {
    --decimals;
  }
  Value8 coded = fromDouble(*value, decimals);
  while (coded.exp > 0 && coded.value % 10 == 0) {
    coded.value /= 10;
    --coded.exp;
  }
  return coded;
}

Writer& Writer::u8(std::uint8_t value) {
  data_.push_back(value);
  return *this;
}

Writer& Writer::u16(std::uint16_t value) {
  u8(static_cast<std::uint8_t>(value >> 8));
  return u8(static_cast<std::uint8_t>(value));
}

Writer& Writer::u32(std::uint32_t value) {
  u16(static_cast<std::uint16_t>(value >> 16));
  return u16(static_cast<std::uint16_t>(value));
}

Writer& Writer::f64(double value) {
  std::uint64_t bits = 0;
  std::memcpy(&bits, &value, sizeof bits);
  u32(static_cast<std::uint32_t>(bits >> 32));
  return u32(static_cast<std::uint32_t>(bits));
}

Writer& Writer::value8(const Value8& value) {
  i32(value.value);
  u16(value.base);
  return i16(value.exp);
}

Writer& Writer::zeros(std::size_t count) {
  data_.resize(data_.size() + count, 0);
  return *this;
}

Writer& Writer::bytes(const Bytes& data) {
  appendTo(data_, data);
  return *this;
}

Writer& Writer::text(std::string_view text, std::size_t width, char fill) {
  for (std::size_t i = 0; i < width; ++i) {
    u8(static_cast<std::uint8_t>(i < text.size() ? text[i] : fill));
  }
  return *this;
}

const std::uint8_t* Reader::take(std::size_t count) {
  if (count > remaining()) {
    throw WireError("FOCAS data end early: expected " + std::to_string(count) + " bytes, found " +
                    std::to_string(remaining()));
  }
  const std::uint8_t* start = data_ + position_;
  position_ += count;
  return start;
}

std::uint8_t Reader::u8() {
  return *take(1);
}

std::uint16_t Reader::u16() {
  const std::uint8_t* p = take(2);
  return static_cast<std::uint16_t>((p[0] << 8) | p[1]);
}

std::uint32_t Reader::u32() {
  const std::uint32_t high = u16();
  return (high << 16) | u16();
}

double Reader::f64() {
  const std::uint64_t high = u32();
  const std::uint64_t bits = (high << 32) | u32();
  double value = 0.0;
  std::memcpy(&value, &bits, sizeof value);
  return value;
}

Value8 Reader::value8() {
  Value8 value;
  value.value = i32();
  value.base = u16();
  value.exp = i16();
  return value;
}

Bytes Reader::bytes(std::size_t count) {
  const std::uint8_t* start = take(count);
  return Bytes(start, start + count);
}

std::string Reader::text(std::size_t width) {
  const std::uint8_t* start = take(width);
  return std::string(start, std::find(start, start + width, 0));
}

std::string Reader::line(std::size_t width) {
  std::string content = text(width);
  std::replace_if(
      content.begin(), content.end(), [](char c) { return c < ' ' || c > '~'; }, '?');
  return content;
}

Reader& Reader::skip(std::size_t count) {
  take(count);
  return *this;
}

Bytes encodeFrame(std::uint8_t type, std::uint8_t direction, const Bytes& body, std::uint16_t version) {
  if (body.size() > MAX_BODY) {
    throw WireError("FOCAS frame of " + std::to_string(body.size()) +
                    " bytes is longer than its length field");
  }
  Writer writer;
  writer.u32(0xa0a0a0a0).u16(version).u8(type).u8(direction).u16(static_cast<std::uint16_t>(body.size()));
  return writer.bytes(body).data();
}

void FrameReader::append(const std::uint8_t* data, std::size_t size) {
  if (start_ > 0) {
    buffer_.erase(buffer_.begin(), buffer_.begin() + static_cast<std::ptrdiff_t>(start_));
    start_ = 0;
  }
  buffer_.insert(buffer_.end(), data, data + size);
}

std::optional<Frame> FrameReader::next() {
  const std::uint8_t* head = buffer_.data() + start_;
  const std::size_t available = buffered();
  for (std::size_t i = 0; i < std::min<std::size_t>(available, 4); ++i) {
    if (head[i] != 0xa0) {
      throw WireError("not a FOCAS frame: byte " + std::to_string(i) + " is " + std::to_string(head[i]) +
                      ", expected a0 (160)");
    }
  }
  if (available < HEADER_SIZE) {
    return std::nullopt;
  }
  Reader reader(head, available);
  Frame frame;
  frame.version = reader.skip(4).u16();
  frame.type = reader.u8();
  frame.direction = reader.u8();
  const std::size_t body_size = reader.u16();
  if (reader.remaining() < body_size) {
    return std::nullopt;
  }
  frame.body = reader.bytes(body_size);
  start_ += HEADER_SIZE + body_size;
  return frame;
}

Bytes encodeErrorBody(const ErrorBody& error) {
  return Writer().i16(error.location).i16(error.code).i16(error.detail1).i16(error.detail2).data();
}

ErrorBody decodeErrorBody(const Bytes& body) {
  ErrorBody error;
  Reader reader(body);
  if (reader.remaining() < 4) {
    error.code = EW_PROTOCOL;
    return error;
  }
  error.location = reader.i16();
  error.code = reader.i16();
  error.detail1 = reader.remaining() >= 2 ? reader.i16() : std::int16_t{0};
  error.detail2 = reader.remaining() >= 2 ? reader.i16() : std::int16_t{0};
  return error;
}

Bytes encodeRequests(const std::vector<SubRequest>& requests) {
  Writer writer;
  writer.u16(static_cast<std::uint16_t>(requests.size()));
  for (const SubRequest& request : requests) {
    const std::size_t length = SUB_REQUEST_SIZE + request.extra.size();
    if (length > MAX_BODY) {
      throw WireError("FOCAS request of " + std::to_string(length) +
                      " bytes is longer than its length field");
    }
    writer.u16(static_cast<std::uint16_t>(length)).u16(request.c1).u16(request.c2).u16(request.c3);
    for (std::int32_t v : request.v) {
      writer.i32(v);
    }
    writer.i32(static_cast<std::int32_t>(request.extra.size())).bytes(request.extra);
  }
  if (writer.data().size() > MAX_BODY) {
    throw WireError("too many FOCAS requests for one frame");
  }
  return writer.data();
}

std::vector<SubRequest> decodeRequests(const Bytes& body) {
  Reader reader(body);
  const std::size_t count = reader.u16();
  std::vector<SubRequest> requests;
  for (std::size_t i = 0; i < count; ++i) {
    const std::size_t length = reader.u16();
    if (length < SUB_REQUEST_SIZE) {
      throw WireError("FOCAS request " + std::to_string(i) + " states a length of " + std::to_string(length) +
                      " bytes");
    }
    const Bytes content = reader.bytes(length - 2);
    Reader sub(content);
    SubRequest request;
    request.c1 = sub.u16();
    request.c2 = sub.u16();
    request.c3 = sub.u16();
    for (std::int32_t& v : request.v) {
      v = sub.i32();
    }
    const std::int32_t extra = sub.i32();
    // v5 is the length of the extra bytes, but 0 or a value in some calls; the length of the packet is
    // reliable.
    (void)extra;
    request.extra = sub.bytes(sub.remaining());
    requests.push_back(std::move(request));
  }
  return requests;
}

Bytes encodeReplies(const std::vector<SubReply>& replies) {
  Writer writer;
  writer.u16(static_cast<std::uint16_t>(replies.size()));
  for (const SubReply& reply : replies) {
    const std::size_t length = SUB_REPLY_SIZE + reply.data.size();
    if (length > MAX_BODY) {
      throw WireError("FOCAS reply of " + std::to_string(length) + " bytes is longer than its length field");
    }
    writer.u16(static_cast<std::uint16_t>(length)).u16(reply.c1).u16(reply.c2).u16(reply.c3);
    writer.i16(reply.code).i16(reply.detail).i16(0).u16(static_cast<std::uint16_t>(reply.data.size()));
    writer.bytes(reply.data);
  }
  if (writer.data().size() > MAX_BODY) {
    throw WireError("FOCAS replies do not fit one frame");
  }
  return writer.data();
}

std::vector<SubReply> decodeReplies(const Bytes& body) {
  Reader reader(body);
  const std::size_t count = reader.u16();
  std::vector<SubReply> replies;
  for (std::size_t i = 0; i < count; ++i) {
    const std::size_t length = reader.u16();
    if (length < SUB_REPLY_SIZE) {
      throw WireError("FOCAS reply " + std::to_string(i) + " states a length of " + std::to_string(length) +
                      " bytes");
    }
    const Bytes content = reader.bytes(length - 2);
    Reader sub(content);
    SubReply reply;
    reply.c1 = sub.u16();
    reply.c2 = sub.u16();
    reply.c3 = sub.u16();
    reply.code = sub.i16();
    reply.detail = sub.i16();
    const std::size_t size = sub.skip(2).u16();
    reply.data = sub.bytes(std::min(size, sub.remaining()));
    replies.push_back(std::move(reply));
  }
  return replies;
}

Bytes encodeOpenReply(const OpenReply& reply) {
  const std::size_t paths = static_cast<std::size_t>(std::max(reply.paths, 1));
  Writer writer;
  writer.zeros(6).u16(static_cast<std::uint16_t>(reply.axes)).u16(static_cast<std::uint16_t>(reply.spindles));
  writer.u16(static_cast<std::uint16_t>(paths)).zeros(8).u16(reply.spindle_meter ? 1 : 0).zeros(6);
  writer.u16(reply.extended ? 1 : 0).zeros(OPEN_REPLY_FIXED - 30);
  for (std::size_t i = 0; i < paths; ++i) {
    writer.u16(1).zeros(OPEN_REPLY_PATH - 2);
  }
  return writer.data();
}

OpenReply decodeOpenReply(const Bytes& body) {
  OpenReply reply;
  if (body.size() < OPEN_REPLY_FIXED) {
    return reply;
  }
  Reader reader(body);
  reply.axes = reader.skip(6).u16();
  reply.spindles = reader.u16();
  reply.paths = reader.u16();
  reply.spindle_meter = reader.skip(8).u16() != 0;
  reply.extended = (reader.skip(6).u16() & 1) != 0;
  return reply;
}

}  // namespace smartmill::focas
