#include "smartmill_daq/acquisition/acquisition.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <thread>
#include <utility>

#include "smartmill_core/formatted.h"

namespace smartmill::daq {
namespace {

constexpr double READ_TIMEOUT = 0.05;  // [s] a quarter of the 0.2 s in which a fault is announced
constexpr double RETRY = 0.5;          // [s] between attempts to open a device
constexpr double RATE_WINDOW = 1.0;    // [s] over which samples are counted
constexpr double COARSE_RATE = 0.1;    // [1] beyond what stalls of a busy computer can make of that count
constexpr double CERTAIN = 5.0;        // standard deviations

}  // namespace

Acquisition::Acquisition(Instrument instrument, std::unique_ptr<Driver> driver, Outputs outputs,
                         std::function<double()> now)
    : instrument_(std::move(instrument)),
      driver_(std::move(driver)),
      outputs_(std::move(outputs)),
      now_(std::move(now)),
      log_(outputs_.fault),
      maker_(instrument_, driver_->shareOfRange()),
      clock_(instrument_.sample_rate),
      stamp_of_([this](std::uint64_t first, std::size_t samples) { return stampOf(first, samples); }) {
}

Acquisition::~Acquisition() {
  driver_->close();
}

bool Acquisition::step() {
  if (ended_) return false;
  if (!open_) {
    const double now = now_();
    if (!ever_open_ || now - tried_ >= RETRY || now < tried_) tryToOpen(now);
    if (!open_) {
      std::this_thread::sleep_for(std::chrono::milliseconds(20));
      return true;
    }
  }
  RawBatch batch;
  try {
    const bool any = driver_->read(&batch, READ_TIMEOUT);
    batch.arrival = now_();
    const std::lock_guard<std::mutex> lock(mutex_);
    if (any) {
      take(batch);
    } else if (driver_->ended()) {
      ended_ = true;
    } else if (!silent_ && batch.arrival - heard_ > instrument_.silence) {
      silent_ = true;
      begin(FaultKind::silent, batch.arrival, formatted("no samples for %.2f s", batch.arrival - heard_));
    }
  } catch (const MalformedData& error) {
    const std::lock_guard<std::mutex> lock(mutex_);
    begin(FaultKind::malformed, now_(), error.what());
    lose(error.what(), now_());
  } catch (const DeviceLost& error) {
    const std::lock_guard<std::mutex> lock(mutex_);
    lose(error.what(), now_());
  }
  if (ended_) finish();
  return !ended_;
}

void Acquisition::tryToOpen(double now) {
  tried_ = now;
  try {
    driver_->open();
    const std::lock_guard<std::mutex> lock(mutex_);
    open_ = true;
    gone_ = false;
    problem_.clear();
    heard_ = now_();
    interrupted_ = interrupted_ || ever_open_;
    ever_open_ = true;
  } catch (const DeviceLost& error) {
    const std::lock_guard<std::mutex> lock(mutex_);
    ever_open_ = true;
    lose(error.what(), now);
  }
}

void Acquisition::lose(const std::string& reason, double now) {
  open_ = silent_ = false;
  driver_->close();
  if (clock_.begun()) send(maker_.flush(stamp_of_));
  interrupted_ = true;
  problem_ = reason;
  if (!gone_) begin(FaultKind::unplugged, now, reason);
  gone_ = true;
}

void Acquisition::take(RawBatch& batch) {
  const std::size_t samples = batch.values.size() / maker_.inputs();
  if (samples == 0) return;
  heard_ = batch.arrival;
  silent_ = false;
  if (instrument_.clock == ClockSource::device && !batch.time)
    throw Error("clock: device, but driver " + instrument_.driver + " delivers samples without a time");
  const std::uint64_t first = place(batch, samples);
  next_ = first + samples;
  if (batch.first_index) device_index_ = *batch.first_index + samples;
  const bool by_device = instrument_.clock == ClockSource::device;
  if (clock_.add(next_, endOf(batch, samples))) {
    begin(FaultKind::clock, batch.arrival,
          formatted("%s have jumped by %.4f s: a clock was set, or samples are missing without a count",
                    by_device ? "the device's times" : "arrivals", clock_.state().last_jump));
  }
  if (by_device) {
    device_time_ = *batch.time;
    device_time_index_ = static_cast<double>(first);
  }
  checkRate(batch, endOf(batch, samples));
  send(maker_.push(batch, first, stamp_of_, log_));
}

double Acquisition::stampOf(std::uint64_t first, std::size_t samples) const {
  const double index = static_cast<double>(first);
  if (instrument_.clock == ClockSource::device)
    return device_time_ + (index - device_time_index_) / instrument_.sample_rate;
  // Readers count on from the stamp with the nominal rate: right in the middle, a block is nowhere off by
  // more than half its length times the drift. The clock's sample ends where the next one begins.
  const double half = 0.5 * static_cast<double>(samples - 1);
  return clock_.timeOf(index + half + 1.0) - half / instrument_.sample_rate - instrument_.latency;
}

double Acquisition::endOf(const RawBatch& batch, std::size_t samples) const {
  return instrument_.clock == ClockSource::device
             ? *batch.time + static_cast<double>(samples) / instrument_.sample_rate
             : batch.arrival;
}

std::uint64_t Acquisition::missingByClock(const RawBatch& batch, std::size_t samples) {
  if (!clock_.begun()) return 0;
  // The batch arrives as late as those before it.
  const double expected = clock_.timeOf(static_cast<double>(next_ + samples));
  const double missing = (endOf(batch, samples) - clock_.state().jitter - expected) * instrument_.sample_rate;
  return missing > 0.0 ? static_cast<std::uint64_t>(std::llround(missing)) : 0;
}

std::uint64_t Acquisition::place(const RawBatch& batch, std::size_t samples) {
  const bool interrupted = std::exchange(interrupted_, false) || batch.interrupted;
  if (!clock_.begun() && next_ == 0 && batch.first_index)
    return *batch.first_index;  // the first batch of all
  // A counter that runs on is better than the clock, unless it began anew.
  if (batch.first_index && device_index_ && *batch.first_index >= *device_index_) {
    const std::uint64_t lost = *batch.first_index - *device_index_;
    if (lost == 0) return next_;
    account_.lost += lost;
    log_.add(FaultKind::gap, lost);
    log_.begin({FaultKind::gap, batch.arrival, next_, std::to_string(lost) + " samples are missing"});
    return next_ + lost;
  }
  const bool began_anew = batch.first_index && device_index_;
  if (interrupted || began_anew) {
    if (!device_index_ && !clock_.begun()) return next_;  // nothing was there before
    const std::uint64_t missing = missingByClock(batch, samples);
    account_.estimated_lost += missing;
    log_.add(FaultKind::interruption, missing);
    log_.begin({FaultKind::interruption, batch.arrival, next_,
                formatted("about %llu samples are missing%s", static_cast<unsigned long long>(missing),
                          began_anew ? ", the device counts anew" : "")});
    // The estimate may be off by some samples.
    send(maker_.flush(stamp_of_));
    clock_.restart(next_ + missing);
    rate_begin_ = -1.0;
    return next_ + missing;
  }
  if (batch.lost > 0) {
    account_.lost += batch.lost;
    log_.add(FaultKind::gap, batch.lost);
    log_.begin({FaultKind::gap, batch.arrival, next_,
                std::to_string(batch.lost) + " samples are missing, the driver reports"});
  }
  return next_ + batch.lost;
}

void Acquisition::checkRate(const RawBatch& batch, double end) {
  const double nominal = instrument_.sample_rate, tolerance = instrument_.rate_tolerance;
  std::optional<double> wrong;
  bool known = false;
  if (batch.sample_rate) {
    known = true;
    if (std::abs(*batch.sample_rate / nominal - 1.0) > tolerance) wrong = *batch.sample_rate;
  }
  const ClockState& clock = clock_.state();
  if (!wrong && std::abs(clock.drift) > tolerance + CERTAIN * clock.drift_std)
    wrong = nominal / (1.0 + clock.drift);
  if (clock.span > RATE_WINDOW && clock.drift_std < tolerance / CERTAIN) known = true;
  if (rate_begin_ < 0.0) {
    rate_begin_ = end;
    rate_count_ = next_;
  } else if (end - rate_begin_ > RATE_WINDOW) {
    const double counted = static_cast<double>(next_ - rate_count_) / (end - rate_begin_);
    // One of two may be short of samples that come late, or hold what the device had stored.
    const double deviation = counted / nominal - 1.0;
    const double least = std::min(std::abs(deviation), std::abs(rate_deviation_));
    rate_counted_.reset();
    if (least > COARSE_RATE && deviation * rate_deviation_ > 0.0) rate_counted_ = counted;
    rate_deviation_ = deviation;
    rate_begin_ = end;
    rate_count_ = next_;
  }
  if (!wrong) wrong = rate_counted_;
  if (wrong && !rate_wrong_) {
    rate_wrong_ = true;
    begin(FaultKind::rate, batch.arrival,
          formatted("%.6g samples per second, expected %.6g: no blocks until it is right", *wrong, nominal));
  } else if (!wrong && known) {
    rate_wrong_ = false;
  }
}

void Acquisition::send(const Blocks& blocks) {
  for (std::size_t s = 0; s < blocks.size(); ++s) {
    for (const SampleBlock& block : blocks[s]) {
      if (rate_wrong_) {
        if (s == 0) {
          account_.withheld += block.size();
          log_.add(FaultKind::rate, block.size());
        }
        continue;
      }
      if (s == 0) account_.delivered += block.size();
      ++account_.blocks;
      if (outputs_.block) outputs_.block(instrument_.streams[s], block);
    }
  }
}

void Acquisition::finish() {
  const std::lock_guard<std::mutex> lock(mutex_);
  if (clock_.begun()) send(maker_.flush(stamp_of_));
}

void Acquisition::begin(FaultKind kind, double time, const std::string& text) {
  log_.begin({kind, time, next_, text});
}

InstrumentState Acquisition::state() const {
  const std::lock_guard<std::mutex> lock(mutex_);
  InstrumentState state;
  state.open = open_;
  state.silent = silent_;
  state.rate_wrong = rate_wrong_;
  state.ended = ended_;
  state.problem = problem_;
  state.account = account_;
  state.clock = clock_.state();
  state.levels = maker_.levels();
  state.faults = log_;
  return state;
}

}  // namespace smartmill::daq
