#include "smartmill_daq/drivers/frame.h"

#include <cmath>
#include <cstring>
#include <limits>

#include "smartmill_core/error.h"

namespace smartmill::daq {
namespace {

constexpr char MAGIC[] = {'S', 'M', 'D', '1'};
constexpr double INT16_RANGE = 32768.0, INT32_RANGE = 2147483648.0;

/// A little-endian number, whatever the computer's order is.
template <class Number>
Number get(const char* bytes) {
  std::uint64_t bits = 0;
  for (std::size_t i = sizeof(Number); i-- > 0;) bits = bits << 8U | static_cast<unsigned char>(bytes[i]);
  Number number{};
  if constexpr (sizeof(Number) == 8) {
    std::memcpy(&number, &bits, sizeof number);
  } else if constexpr (sizeof(Number) == 4) {
    const auto half = static_cast<std::uint32_t>(bits);
    std::memcpy(&number, &half, sizeof number);
  } else {
    number = static_cast<Number>(bits);
  }
  return number;
}

template <class Number>
void put(Number number, std::string* bytes) {
  std::uint64_t bits = 0;
  if constexpr (sizeof(Number) == 8) {
    std::memcpy(&bits, &number, sizeof number);
  } else if constexpr (sizeof(Number) == 4) {
    std::uint32_t half = 0;
    std::memcpy(&half, &number, sizeof number);
    bits = half;
  } else {
    bits = static_cast<std::make_unsigned_t<Number>>(number);
  }
  for (std::size_t i = 0; i < sizeof(Number); ++i)
    bytes->push_back(static_cast<char>(bits >> (8 * i) & 0xFFU));
}

template <class Number>
void getValues(const char* bytes, double factor, std::vector<double>* values) {
  for (double& value : *values) {
    value = factor * static_cast<double>(get<Number>(bytes));
    bytes += sizeof(Number);
  }
}

template <class Integer>
void putShares(const std::vector<double>& values, double range, std::string* bytes) {
  for (const double value : values) {
    const double code = std::round(value * range);
    if (!(code >= -range && code < range)) throw Error("frame: a share of the range beyond -1..1");
    put(static_cast<Integer>(code), bytes);
  }
}

}  // namespace

std::size_t bytesOf(SampleFormat format) {
  switch (format) {
    case SampleFormat::int16:
      return 2;
    case SampleFormat::int32:
    case SampleFormat::float32:
      return 4;
    case SampleFormat::float64:
      return 8;
  }
  return 0;
}

std::string encode(const Frame& frame) {
  if (frame.channels < 1 || frame.channels > MOST_CHANNELS || frame.values.empty() ||
      frame.values.size() % frame.channels != 0)
    throw Error("frame: " + std::to_string(frame.values.size()) + " values for " +
                std::to_string(frame.channels) + " channels");
  const std::size_t payload = frame.values.size() * bytesOf(frame.format);
  if (payload > LARGEST_FRAME) throw Error("frame: more than 8 MiB of samples");
  std::string bytes(MAGIC, sizeof MAGIC);
  bytes.reserve(FRAME_HEADER + payload);
  put(static_cast<std::uint8_t>(frame.format), &bytes);
  put(static_cast<std::uint8_t>(frame.channels), &bytes);
  put(std::uint16_t{0}, &bytes);
  put(static_cast<std::uint32_t>(frame.size()), &bytes);
  put(static_cast<std::uint32_t>(payload), &bytes);
  put(frame.first_index, &bytes);
  put(frame.time, &bytes);
  put(frame.sample_rate, &bytes);
  put(frame.overloaded, &bytes);
  put(frame.bias_fault, &bytes);
  switch (frame.format) {
    case SampleFormat::int16:
      putShares<std::int16_t>(frame.values, INT16_RANGE, &bytes);
      break;
    case SampleFormat::int32:
      putShares<std::int32_t>(frame.values, INT32_RANGE, &bytes);
      break;
    case SampleFormat::float32:
      for (const double value : frame.values) put(static_cast<float>(value), &bytes);
      break;
    case SampleFormat::float64:
      for (const double value : frame.values) put(value, &bytes);
      break;
  }
  return bytes;
}

std::optional<Frame> FrameDecoder::next() {
  const std::size_t there = bytes_.size() - at_;
  const char* const header = bytes_.data() + at_;
  if (std::memcmp(header, MAGIC, std::min(there, sizeof MAGIC)) != 0)
    throw Error("frame: begins with other bytes than SMD1");
  if (there < FRAME_HEADER) return std::nullopt;
  Frame frame;
  const auto format = get<std::uint8_t>(header + 4);
  if (format < 1 || format > 4)
    throw Error("frame: sample format " + std::to_string(format) + ", expected 1 to 4");
  frame.format = static_cast<SampleFormat>(format);
  frame.channels = get<std::uint8_t>(header + 5);
  if (frame.channels < 1 || frame.channels > MOST_CHANNELS)
    throw Error("frame: " + std::to_string(frame.channels) + " channels, expected 1 to 64");
  if (get<std::uint16_t>(header + 6) != 0) throw Error("frame: bytes 6 and 7 are not 0");
  const std::size_t samples = get<std::uint32_t>(header + 8), payload = get<std::uint32_t>(header + 12);
  if (samples < 1 || payload > LARGEST_FRAME || samples * frame.channels * bytesOf(frame.format) != payload)
    throw Error("frame: " + std::to_string(payload) + " bytes do not hold " + std::to_string(samples) +
                " samples of " + std::to_string(frame.channels) + " channels, or are more than 8 MiB");
  frame.first_index = get<std::uint64_t>(header + 16);
  if (frame.first_index > std::numeric_limits<std::uint64_t>::max() / 2)
    throw Error("frame: the index is larger than 2^63");
  frame.time = get<std::int64_t>(header + 24);
  frame.sample_rate = get<double>(header + 32);
  if (!(frame.sample_rate >= 0.0) || !std::isfinite(frame.sample_rate))
    throw Error("frame: sample rate is no positive number");
  frame.overloaded = get<std::uint64_t>(header + 40);
  frame.bias_fault = get<std::uint64_t>(header + 48);
  if (there < FRAME_HEADER + payload) return std::nullopt;
  frame.values.resize(samples * frame.channels);
  const char* const data = header + FRAME_HEADER;
  switch (frame.format) {
    case SampleFormat::int16:
      getValues<std::int16_t>(data, 1.0 / INT16_RANGE, &frame.values);
      break;
    case SampleFormat::int32:
      getValues<std::int32_t>(data, 1.0 / INT32_RANGE, &frame.values);
      break;
    case SampleFormat::float32:
      getValues<float>(data, 1.0, &frame.values);
      break;
    case SampleFormat::float64:
      getValues<double>(data, 1.0, &frame.values);
      break;
  }
  at_ += FRAME_HEADER + payload;
  // The used bytes are removed once for many frames.
  if (at_ == bytes_.size() || at_ > LARGEST_FRAME) {
    bytes_.erase(0, at_);
    at_ = 0;
  }
  return frame;
}

}  // namespace smartmill::daq
