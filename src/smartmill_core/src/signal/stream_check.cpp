#include "smartmill_core/signal/stream_check.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "smartmill_core/formatted.h"
#include "smartmill_core/signal/stream_sorter.h"
#include "smartmill_core/units.h"

namespace smartmill {
namespace {

constexpr double WINDOW = 0.2;   // [s] of stamps, half of the time in which a fault is to be announced
constexpr double PRESENT = 1.0;  // [s] without a further event after which a fault is over
constexpr double REPEAT = 5.0;   // [s] between lines about a fault that lasts
constexpr double LIMIT = 1e9;    // [N, V, A, m, m/s2] beyond every sensor of a machine tool
constexpr double RATE_TOLERANCE = 0.03;  // [1] stamps of arrival jitter by some milliseconds in a window
constexpr double LEAST_JUMP = 0.01;      // [s] length of a block
constexpr std::size_t LEAST_RUN = 20;    // [samples] of a slow stream
constexpr double LARGEST_SPEED = 1e5;    // [rad/s]
constexpr double ANGLE_SHARE = 0.25;     // [1] of the advance that the speed states
constexpr double ANGLE_STEP = 0.5;       // [rad] of one reading
constexpr double ANGLE_NOISE = 0.3;      // [rad] of a window
// [rad] of a window: an orientation, which may turn backwards at an unsigned speed, is less.
constexpr double LEAST_ADVANCE = 2.0 * units::TWO_PI;
constexpr double LONGEST_WINDOW = 2.0;  // [s] at rest
constexpr std::size_t LEAST_READINGS = 5;
constexpr double LOST_PERIODS = 5.0;  // [1] mean periods without a reading, or of one block, that are a fault
constexpr double STEADY_TIME = 0.25;  // [s] of both speeds
constexpr double STEADY_SHARE = 0.02;  // [1] change of a steady speed
constexpr double SPEED_SHARE = 0.1;    // [1] difference of the speeds; slip and rounding are far less
constexpr double PERIOD_SHARE = 0.1;   // [1] weight of a reading or block in the mean period

}  // namespace

void StreamCheck::reset() {
  newest_ = NEVER;
  for (Episode& episode : episodes_) episode.seen = episode.announced = NEVER;
  next_index_.reset();
  channels_.clear();
  window_samples_ = 0;
  wrong_windows_ = 0;
  length_ = 0.0;
  reading_.reset();
  period_ = 0.0;
  disagrees_ = false;
  window_ = {};
}

void StreamCheck::note(Kind kind, double stamp, std::size_t count, const std::string& text) {
  Episode& episode = episodes_[static_cast<std::size_t>(kind)];
  const bool begins = stamp - episode.seen > PRESENT;
  episode.seen = stamp;
  episode.count += count;
  if (!begins && stamp - episode.announced < REPEAT) return;
  episode.announced = stamp;
  episode.line = text + formatted(" at %.3f s", stamp);
  lines_.push_back(episode.line);
}

std::vector<std::string> StreamCheck::takeLines() {
  return std::exchange(lines_, {});
}

std::string StreamCheck::present() const {
  for (const Episode& episode : episodes_) {
    if (newest_ - episode.seen <= PRESENT) return episode.line;
  }
  return {};
}

bool StreamCheck::check(SampleBlock& block) {
  if (block.stamp < newest_ - StreamSorter::RESTART || channels_.size() != block.channels.size()) {
    const double back = newest_ - block.stamp;
    // The index of a recording that is played again starts again, too.
    const bool jumped = next_index_ && block.first_index >= *next_index_ && back > 0.0;
    reset();
    channels_.resize(block.channels.size());
    for (std::size_t c = 0; c < channels_.size(); ++c) channels_[c].name = block.channels[c];
    if (jumped)
      note(Kind::jump, block.stamp, 1, formatted("stamps jumped back by %.3f s against the index", back));
  }
  if (block.size() == 0) return true;
  if (isRepeated(block)) {
    note(Kind::duplicate, block.stamp, 1,
         formatted("block of index %llu received twice", static_cast<unsigned long long>(block.first_index)));
    return false;
  }
  checkStamps(block);
  checkLength(block);
  checkValues(block);
  first_index_ = block.first_index;
  next_index_ = block.first_index + block.size();
  rate_ = block.sample_rate;
  newest_ = block.stamp;
  if (wrong_windows_ < 2) return true;
  note(Kind::rate, block.stamp, 1, "blocks of a wrong sample_rate are not used");
  return false;
}

bool StreamCheck::isRepeated(const SampleBlock& block) {
  if (!next_index_ || block.first_index >= *next_index_) return false;
  // A source that counts anew continues in time.
  const double length = static_cast<double>(block.size()) / block.sample_rate;
  return block.stamp < newest_ + 0.5 * length;
}

void StreamCheck::checkStamps(const SampleBlock& block) {
  if (!next_index_) return;
  if (block.first_index < *next_index_) {
    note(Kind::gap, block.stamp, 1,
         formatted("index restarted at %llu, expected %llu",
                   static_cast<unsigned long long>(block.first_index),
                   static_cast<unsigned long long>(*next_index_)));
    window_ = {};
    return;
  }
  if (block.first_index > *next_index_) {
    const std::uint64_t lost = block.first_index - *next_index_;
    lost_samples_ += lost;
    note(Kind::gap, block.stamp, 1, formatted("%llu samples lost", static_cast<unsigned long long>(lost)));
  }
  if (block.sample_rate != rate_) {
    note(Kind::rate, block.stamp, 1,
         formatted("sample_rate changed from %.6g to %.6g Hz", rate_, block.sample_rate));
  }
  const double nominal = static_cast<double>(block.first_index - first_index_) / rate_;
  const double error = block.stamp - newest_ - nominal;
  window_.time += nominal;
  window_.error += error;
  if (std::abs(error) > std::abs(window_.largest)) window_.largest = error;
  if (window_.time >= WINDOW) endStampWindow(block);
}

void StreamCheck::endStampWindow(const SampleBlock& block) {
  const Window window = std::exchange(window_, {});
  if (std::abs(window.error - window.largest) > RATE_TOLERANCE * window.time) {
    ++wrong_windows_;
    note(Kind::rate, block.stamp, 1,
         formatted("sample_rate %.6g Hz, but stamps and index give %.6g Hz", block.sample_rate,
                   rate_ * window.time / (window.time + window.error)));
    return;
  }
  wrong_windows_ = 0;
  if (std::abs(window.largest) > LEAST_JUMP)
    note(Kind::jump, block.stamp, 1, formatted("stamps jumped by %.3f s against the index", window.largest));
}

void StreamCheck::checkLength(const SampleBlock& block) {
  const double length = static_cast<double>(block.size()) / block.sample_rate;
  if (length_ > 0.0 && length > LOST_PERIODS * length_) {
    note(Kind::length, block.stamp, 1,
         formatted("block of %.3f s, usually %.3f s: delayed", length, length_));
    return;
  }
  length_ += (length_ > 0.0 ? PERIOD_SHARE : 1.0) * (length - length_);
}

StreamCheck::Unchanged StreamCheck::longestUnchanged() const {
  Unchanged longest;
  for (const Channel& channel : channels_) {
    const double duration = rate_ > 0.0 ? static_cast<double>(channel.run) / rate_ : 0.0;
    if (duration > longest.duration) longest = {channel.name, duration};
  }
  return longest;
}

void StreamCheck::checkValues(SampleBlock& block) {
  const std::size_t width = block.channels.size(), size = block.size();
  const std::size_t long_run = std::max(LEAST_RUN, static_cast<std::size_t>(WINDOW * block.sample_rate));
  std::size_t invalid = 0;
  std::size_t invalid_channel = 0;
  for (std::size_t c = 0; c < width; ++c) {
    Channel& channel = channels_[c];
    std::size_t stuck = 0;
    for (std::size_t i = 0; i < size; ++i) {
      double& value = block.samples[i * width + c];
      if (!(std::abs(value) <= LIMIT)) {
        value = NOT_A_NUMBER;
        ++invalid;
        invalid_channel = c;
        continue;
      }
      if (value != channel.last) {
        ++channel.changes;
        channel.last = value;
        channel.run = 0;
        channel.stuck = false;
        continue;
      }
      if (++channel.run == 2) channel.was_noisy = channel.noisy[0] || channel.noisy[1];
      if (channel.run >= long_run && channel.was_noisy && source_ == Source::sensor) channel.stuck = true;
      if (!channel.stuck) continue;
      value = NOT_A_NUMBER;
      ++stuck;
    }
    if (stuck > 0)
      note(Kind::stuck, block.stamp, stuck,
           formatted("channel %s repeats one value: stuck", block.channels[c].c_str()));
  }
  if (invalid > 0)
    note(Kind::value, block.stamp, invalid,
         formatted("channel %s has values that are not finite or beyond 1e9",
                   block.channels[invalid_channel].c_str()));
  window_samples_ += size;
  if (static_cast<double>(window_samples_) < WINDOW * block.sample_rate) return;
  for (Channel& channel : channels_) {
    channel.noisy = {{channel.noisy[1], 2 * channel.changes > window_samples_}};
    channel.changes = 0;
  }
  window_samples_ = 0;
}

bool StreamCheck::check(const SpindleAngle& reading) {
  if (reading.stamp < newest_ - StreamSorter::RESTART) reset();
  // NaN: the angle of a pulse tachometer at rest.
  const bool valid = reading.speed >= 0.0 && reading.speed < LARGEST_SPEED &&
                     !(std::abs(reading.angle) > units::TWO_PI + ANGLE_STEP);
  if (!valid) {
    newest_ = std::max(newest_, reading.stamp);
    note(Kind::value, reading.stamp, 1,
         formatted("angle %.6g rad or speed %.6g rad/s is out of range", reading.angle, reading.speed));
    return false;
  }
  if (reading_ && reading.stamp == reading_->stamp) {
    note(Kind::duplicate, reading.stamp, 1, "reading received twice");
    return false;
  }
  if (reading_) checkAdvance(reading);
  reading_ = reading;
  newest_ = reading.stamp;
  if (!disagrees_) return true;
  note(Kind::angle, reading.stamp, 1, "readings whose angle does not follow their speed are not used");
  return false;
}

void StreamCheck::checkAdvance(const SpindleAngle& reading) {
  const double time = reading.stamp - reading_->stamp;
  const double expected = 0.5 * (reading.speed + reading_->speed) * time;
  const double difference = std::remainder(reading.angle - reading_->angle - expected, units::TWO_PI);
  const bool turns = reading.speed > 0.0 && reading_->speed > 0.0;
  if (time < 0.0) {
    note(Kind::jump, reading.stamp, 1, formatted("stamps jumped back by %.3f s", -time));
    window_ = {};
    return;
  }
  if (turns && period_ > 0.0 && time > LOST_PERIODS * period_) {
    if (std::abs(difference) > ANGLE_STEP) {
      note(Kind::jump, reading.stamp, 1,
           formatted("stamps jumped by %.3f s, which the angle does not confirm", time));
    } else {
      note(Kind::gap, reading.stamp, 1, formatted("no readings for %.3f s", time));
    }
    window_ = {};
    return;
  }
  period_ += (period_ > 0.0 ? PERIOD_SHARE : 1.0) * (time - period_);
  if (!std::isfinite(difference)) return;
  window_.time += time;
  window_.error += difference;
  window_.expected += expected;
  window_.allowed += std::min(ANGLE_SHARE * expected, ANGLE_STEP);
  ++window_.count;
  const bool advanced = window_.expected >= LEAST_ADVANCE || std::abs(window_.error) >= LEAST_ADVANCE;
  if (window_.time < (advanced ? WINDOW : LONGEST_WINDOW) || window_.count < LEAST_READINGS) return;
  const Window window = std::exchange(window_, {});
  disagrees_ = advanced && std::abs(window.error) > window.allowed + ANGLE_NOISE;
  if (disagrees_)
    note(Kind::angle, reading.stamp, 1,
         formatted("angle disagrees with speed: %.2f rad in %.2f s, expected %.2f rad",
                   window.expected + window.error, window.time, window.expected));
}

void SpeedAgreement::setController(double stamp, double speed) {
  controller_stamp_ = stamp;
  controller_ = speed;
}

std::string SpeedAgreement::check(const SpindleAngle& reading) {
  const auto changed = [](double speed, double first) {
    return !(std::abs(speed - first) <= STEADY_SHARE * first);
  };
  const bool known =
      controller_ > 0.0 && reading.speed > 0.0 && std::abs(reading.stamp - controller_stamp_) < STEADY_TIME;
  if (!known || reading.stamp < since_ || changed(reading.speed, first_) ||
      changed(controller_, first_controller_)) {
    since_ = reading.stamp;
    first_ = reading.speed;
    first_controller_ = controller_;
    disagrees_ = false;
    return {};
  }
  if (reading.stamp - since_ < STEADY_TIME) return {};
  disagrees_ = std::abs(reading.speed - controller_) > SPEED_SHARE * controller_;
  if (!disagrees_ || std::abs(reading.stamp - announced_) < REPEAT) return {};
  announced_ = reading.stamp;
  return formatted("speed %.4g rad/s, the controller states %.4g rad/s at %.3f s", reading.speed, controller_,
                   reading.stamp);
}

}  // namespace smartmill
