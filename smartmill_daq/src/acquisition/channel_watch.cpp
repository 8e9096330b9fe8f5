#include "smartmill_daq/acquisition/channel_watch.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>
#include <utility>

#include "smartmill_core/formatted.h"

namespace smartmill::daq {
namespace {

// The largest value of a converter of 16 bit is 0.99997 of its range.
constexpr double CLIPPED = 0.9999;
constexpr double QUIET = 0.1;         // [s] without a further sample of a fault after which it has ended
constexpr double LEVEL_WINDOW = 1.0;  // [s]
constexpr double NOT_MEASURED = std::numeric_limits<double>::quiet_NaN();

}  // namespace

ChannelWatch::ChannelWatch(Channel channel, double sample_rate, bool share_of_range)
    : channel_(std::move(channel)),
      scale_((share_of_range ? channel_.range : 1.0) / channel_.sensitivity),
      share_(share_of_range ? 1.0 : 1.0 / channel_.range),
      offset_(channel_.offset / channel_.sensitivity),
      quiet_(static_cast<std::uint64_t>(QUIET * sample_rate) + 1),
      window_(static_cast<std::uint64_t>(LEVEL_WINDOW * sample_rate) + 1) {
  if (channel_.stuck > 0.0)
    stuck_after_ = std::max<std::uint64_t>(2, static_cast<std::uint64_t>(channel_.stuck * sample_rate));
}

void ChannelWatch::beginBatch(double time, bool overloaded, bool bias_fault) {
  time_ = time;
  overloaded_ = overloaded;
  bias_fault_ = bias_fault;
}

template <class Text>
void ChannelWatch::mark(FaultKind kind, Event& event, std::uint64_t index, std::uint64_t& count,
                        const Text& text, FaultLog& log) {
  if (index >= event.until) log.begin({kind, time_, index, channel_.name + ": " + text()});
  event.until = index + quiet_;
  ++count;
  log.add(kind, 1);
}

double ChannelWatch::value(double raw, std::uint64_t index, FaultLog& log) {
  run_ = raw == last_ ? run_ + 1 : 1;
  last_ = raw;
  const double share = raw * share_;
  const bool stuck = stuck_after_ > 0 && run_ >= stuck_after_;
  const bool clipped = std::abs(share) >= CLIPPED;
  level_.faulty = true;
  if (!std::isfinite(raw)) {
    mark(
        FaultKind::not_finite, not_finite_, index, level_.not_finite,
        [] { return std::string("value is no number"); }, log);
  } else if (bias_fault_) {
    mark(
        FaultKind::bias, bias_, index, level_.bias,
        [] { return std::string("the device reports a fault of the IEPE supply"); }, log);
  } else if (stuck && channel_.coupling == Coupling::iepe) {
    const auto text = [clipped] {
      return std::string(clipped ? "at the end of its range: IEPE cable open"
                                 : "one value only: IEPE cable shorted or supply off");
    };
    mark(FaultKind::bias, bias_, index, level_.bias, text, log);
  } else if (clipped || overloaded_) {
    const auto text = [&] {
      return formatted("clipped at %.4g V of %.4g V", share * channel_.range, channel_.range);
    };
    mark(FaultKind::clipping, clipping_, index, level_.clipped, text, log);
  } else if (stuck) {
    const auto text = [&] {
      return formatted("stuck at %.6g V for %.3g s", share * channel_.range, channel_.stuck);
    };
    mark(FaultKind::stuck, stuck_, index, level_.stuck, text, log);
  } else {
    level_.faulty = false;
    const double value = raw * scale_ - offset_;
    addToLevel(value, std::abs(share));
    return value;
  }
  addToLevel(NOT_MEASURED, std::isfinite(share) ? std::abs(share) : 0.0);
  return NOT_MEASURED;
}

void ChannelWatch::addToLevel(double value, double share) {
  peak_ = std::max(peak_, share);
  if (std::isfinite(value)) {
    if (good_ == 0) first_ = value;  // a mean far from 0 would cost digits
    sum_ += value - first_;
    squares_ += (value - first_) * (value - first_);
    ++good_;
  }
  if (++count_ < window_) return;
  const double n = static_cast<double>(std::max<std::uint64_t>(good_, 1)), mean = sum_ / n;
  level_.mean = good_ > 0 ? first_ + mean : NOT_MEASURED;
  level_.rms = good_ > 0 ? std::sqrt(std::max(0.0, squares_ / n - mean * mean)) : NOT_MEASURED;
  level_.peak = peak_;
  sum_ = squares_ = peak_ = 0.0;
  count_ = good_ = 0;
}

}  // namespace smartmill::daq
