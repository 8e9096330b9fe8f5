#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <string>
#include <utility>

namespace smartmill::daq {

enum class FaultKind : std::uint8_t {
  gap,           ///< the device's count shows that samples are missing
  interruption,  ///< samples are missing, their number is estimated from the clock
  clipping,      ///< a value at the end of the range
  bias,          ///< the supply of an IEPE sensor: cable open or shorted
  stuck,         ///< a channel repeats one value
  not_finite,    ///< a value that is no number
  silent,        ///< no samples for a while
  unplugged,     ///< the device is gone
  rate,          ///< another sample rate than described
  clock,         ///< a clock was set
  malformed      ///< bytes that are no frame
};
constexpr std::size_t FAULT_KINDS = 11;
/// e.g. "gap". Of every kind, for tables.
const char* faultName(FaultKind kind);

/// The beginning of a fault.
struct Fault {
  FaultKind kind = FaultKind::gap;
  double time = 0.0;        ///< [s] when it was noticed
  std::uint64_t index = 0;  ///< [1] running index of its first sample
  std::string text;         ///< one line
};

/// Announces faults where they begin and counts them.
class FaultLog {
 public:
  struct Count {
    std::uint64_t events = 0;
    std::uint64_t samples = 0;  ///< [1] lost or marked, of all channels together
  };

  explicit FaultLog(std::function<void(const Fault&)> announce = {}) : announce_(std::move(announce)) {}

  void begin(const Fault& fault) {
    ++counts_[static_cast<std::size_t>(fault.kind)].events;
    last_ = fault;
    if (announce_) announce_(fault);
  }
  void add(FaultKind kind, std::uint64_t samples) {
    counts_[static_cast<std::size_t>(kind)].samples += samples;
  }
  const Count& count(FaultKind kind) const { return counts_[static_cast<std::size_t>(kind)]; }
  const Fault& last() const { return last_; }  ///< empty text: none

 private:
  std::function<void(const Fault&)> announce_;
  std::array<Count, FAULT_KINDS> counts_{};
  Fault last_;
};

}  // namespace smartmill::daq
