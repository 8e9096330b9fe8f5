#include "smartmill_core/signal/encoder_reader.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "smartmill_core/error.h"
#include "smartmill_core/formatted.h"
#include "smartmill_core/math/angle.h"
#include "smartmill_core/units.h"

namespace smartmill {

EncoderReader::EncoderReader(const EncoderParameters& parameters) : parameters_(parameters) {
  if (!(parameters_.counts_per_revolution >= 1.0))
    throw Error(
        formatted("counts_per_revolution: %g, expected 1 or more", parameters_.counts_per_revolution));
  if (!(parameters_.period > 0.0) || !(parameters_.speed_window > 0.0))
    throw Error("period, speed_window: expected more than 0 s");
}

std::vector<SpindleAngle> EncoderReader::push(const SampleBlock& block) {
  const std::size_t channel = block.channel(ENCODER_CHANNEL);
  if (next_index_ && block.first_index != *next_index_) restart("samples are missing");
  next_index_ = block.first_index + block.size();
  const auto window = std::max<std::size_t>(
      1, static_cast<std::size_t>(std::lround(parameters_.speed_window * block.sample_rate)));
  const auto every =
      std::max<std::size_t>(1, static_cast<std::size_t>(std::lround(parameters_.period * block.sample_rate)));
  const double turn = (parameters_.reversed ? -1.0 : 1.0) * units::TWO_PI / parameters_.counts_per_revolution;
  const double wrap = parameters_.bits > 0 ? std::exp2(parameters_.bits) : 0.0;
  std::vector<SpindleAngle> readings;
  for (std::size_t i = 0; i < block.size(); ++i) {
    const double raw = block.at(i, channel);
    if (!std::isfinite(raw)) {
      restart("a value is no number");
      continue;
    }
    if (counts_.empty()) {
      unwrapped_ = raw;
    } else {
      double step = raw - last_raw_;
      if (wrap > 0.0) step -= wrap * std::round(step / wrap);
      if (std::abs(step * turn) * block.sample_rate >
          parameters_.highest_speed + std::abs(turn) * block.sample_rate) {
        restart(formatted("the counter has jumped by %g", step));
        unwrapped_ = raw;
      } else {
        unwrapped_ += step;
      }
    }
    last_raw_ = raw;
    counts_.push_back(unwrapped_);
    if (counts_.size() > window + 1) counts_.pop_front();
    if (++since_reading_ < every || counts_.size() <= window) continue;
    since_reading_ = 0;
    const double speed =
        (counts_.back() - counts_.front()) * turn * block.sample_rate / static_cast<double>(window);
    readings.push_back({block.timeOf(i), wrapped(parameters_.zero + turn * unwrapped_), std::abs(speed)});
  }
  return readings;
}

double EncoderReader::angleStd() const {
  return units::TWO_PI / parameters_.counts_per_revolution / std::sqrt(12.0);
}

std::string EncoderReader::takeFault() {
  return std::exchange(fault_, {});
}

void EncoderReader::restart(const std::string& fault) {
  ++faults_;
  fault_ = fault;
  counts_.clear();
  since_reading_ = 0;
}

}  // namespace smartmill
