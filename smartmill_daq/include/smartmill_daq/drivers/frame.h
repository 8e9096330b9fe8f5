#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

namespace smartmill::daq {

/// How a sample is written. Integers are shares of the input's range, numbers with a point are volts.
enum class SampleFormat : std::uint8_t { int16 = 1, int32 = 2, float32 = 3, float64 = 4 };
std::size_t bytesOf(SampleFormat format);
inline bool isShare(SampleFormat format) {
  return format == SampleFormat::int16 || format == SampleFormat::int32;
}

/// Samples as a device sends them (docs/daq.md).
struct Frame {
  SampleFormat format = SampleFormat::float32;
  std::size_t channels = 0;
  std::uint64_t first_index = 0;  ///< [1] the device's count of the first sample
  std::int64_t time = 0;          ///< [ns] of the first sample since 1970-01-01 UTC; 0: not stated
  double sample_rate = 0.0;       ///< [Hz]; 0: not stated
  std::uint64_t overloaded = 0, bias_fault = 0;  ///< one bit per channel
  std::vector<double> values;                    ///< interleaved; shares or volts, by format

  std::size_t size() const { return channels == 0 ? 0 : values.size() / channels; }
};

constexpr std::size_t FRAME_HEADER = 56;          // [byte]
constexpr std::size_t MOST_CHANNELS = 64;         // of a frame: one bit each in its masks
constexpr std::size_t LARGEST_FRAME = 1U << 23U;  // [byte] of samples

/// The bytes of a frame. @throws Error on numbers that it cannot hold.
std::string encode(const Frame& frame);

/// Cuts a stream of bytes into frames.
class FrameDecoder {
 public:
  void push(const char* data, std::size_t size) { bytes_.append(data, size); }
  /// The next complete frame. @throws Error on bytes that are no frame; the connection is then of no use.
  std::optional<Frame> next();

 private:
  std::string bytes_;
  std::size_t at_ = 0;  // of the first byte that no frame has used
};

}  // namespace smartmill::daq
