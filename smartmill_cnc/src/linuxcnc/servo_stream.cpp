#include "smartmill_cnc/linuxcnc/servo_stream.h"

#include <algorithm>
#include <utility>

#include "smartmill_core/error.h"
#include "smartmill_core/signal/streams.h"

namespace smartmill::cnc::linuxcnc {
namespace {

constexpr double LATE_BIN = 1e-4;  // [s] resolution of the statistics

}  // namespace

void ServoClock::addArrival(std::uint64_t number, double arrival) {
  const double zero = arrival - static_cast<double>(number) * period_;
  if (!std::exchange(started_, true)) {
    begun_ = window_begun_ = last_ = arrival;
    zero_ = zero;
  }
  window_ = std::min(window_, zero);
  const double earliest = std::min(window_, previous_window_);
  if (settled_) {
    const double most = options_.slew * std::max(0.0, arrival - last_);
    zero_ += std::clamp(earliest - zero_, -most, most);
  } else {
    zero_ = earliest;
    settled_ = arrival - begun_ > options_.settling;
  }
  last_ = arrival;
  if (arrival - window_begun_ > options_.window) {
    window_begun_ = arrival;
    previous_window_ = std::exchange(window_, std::numeric_limits<double>::infinity());
  }
}

ServoStream::ServoStream(const std::string& folder, const ServoStreamOptions& options)
    : path_(folder + "/" + STREAM_SOCKET), options_(options) {
}

std::vector<ServoSegment> ServoStream::step(double wait, double (*now)()) {
  if (!connection_.open() && (now() - last_attempt_ > options_.retry_period || now() < last_attempt_)) {
    last_attempt_ = now();
    try {
      connection_ = LocalConnection::to(path_);
    } catch (const Error&) {
      // The controller's reader reports a silent stream.
    }
  }
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    if (load_ && connection_.open()) {
      connection_.send(SetLoad{*std::exchange(load_, std::nullopt)});
    }
  }
  std::vector<ServoSegment> segments;
  connection_.wait(wait);
  connection_.receive();
  const double arrival = now();
  while (const std::optional<Received> received = connection_.next()) {
    if (const auto* block = std::get_if<ServoBlock>(&received->message)) {
      for (ServoSegment& segment : addBlock(*block, arrival)) {
        segments.push_back(std::move(segment));
      }
    }
  }
  return segments;
}

void ServoStream::restart(const ServoBlock& block) {
  clock_ = ServoClock(static_cast<double>(block.period_ns) * 1e-9);
  next_ = block.first;
  segment_ = {};
  begun_ = true;
}

std::vector<ServoSegment> ServoStream::addBlock(ServoBlock block, double arrival) {
  std::vector<ServoSegment> segments;
  if (block.samples.empty()) {
    return segments;
  }
  const std::lock_guard<std::mutex> lock(mutex_);
  const std::uint32_t gap =
      block.first - static_cast<std::uint32_t>(next_);  // modulo 2^32, as the controller counts
  if (!begun_ || gap > options_.restart_gap) {
    statistics_.restarts += statistics_.samples > 0 ? 1 : 0;
    restart(block);
  } else if (gap > 0) {
    statistics_.lost += gap;
    next_ += gap;
    if (!segment_.samples.empty()) {
      segments.push_back(std::exchange(segment_, {}));
    }
  }
  clock_.addArrival(next_ + block.samples.size() - 1, arrival);
  if (arrival - load_stamp_ > options_.load_timeout) {
    for (ServoSample& sample : block.samples) {
      sample.spindle_load = NOT_A_NUMBER;
    }
    statistics_.without_load += block.samples.size();
  }
  for (const ServoSample& sample : block.samples) {
    const std::uint64_t number = next_++;
    ++statistics_.samples;
    if (!clock_.settled()) {
      continue;
    }
    countLate(arrival - clock_.timeOf(number));
    if (segment_.samples.empty()) {
      segment_.first = number;
      segment_.stamp = clock_.timeOf(number);
    }
    segment_.samples.push_back(sample);
    if (segment_.samples.size() == options_.segment_length) {
      segments.push_back(std::exchange(segment_, {}));
    }
  }
  latest_ = block.samples.back();
  return segments;
}

void ServoStream::countLate(double late) {
  const double bin = std::clamp(late / LATE_BIN, 0.0, static_cast<double>(LATE_BINS - 1));
  ++late_[static_cast<std::size_t>(bin)];
  statistics_.late_worst = std::max(statistics_.late_worst, late);
}

std::optional<ServoSample> ServoStream::latest() const {
  const std::lock_guard<std::mutex> lock(mutex_);
  return latest_;
}

std::uint64_t ServoStream::count() const {
  const std::lock_guard<std::mutex> lock(mutex_);
  return statistics_.samples;
}

void ServoStream::setLoad(double stamp, double spindle_load) {
  const std::lock_guard<std::mutex> lock(mutex_);
  load_stamp_ = stamp;
  load_ = spindle_load;
}

ServoStatistics ServoStream::statistics() const {
  const std::lock_guard<std::mutex> lock(mutex_);
  ServoStatistics result = statistics_;
  std::uint64_t all = 0, below = 0;
  for (const std::uint64_t n : late_) {
    all += n;
  }
  for (std::size_t bin = 0; bin < LATE_BINS; ++bin) {
    const bool below_median = 2 * below < all, below_99 = 100 * below < 99 * all;
    below += late_[bin];
    const double end = static_cast<double>(bin + 1) * LATE_BIN;
    if (below_median && 2 * below >= all) {
      result.late_median = end;
    }
    if (below_99 && 100 * below >= 99 * all) {
      result.late_99 = end;
    }
  }
  return result;
}

}  // namespace smartmill::cnc::linuxcnc
