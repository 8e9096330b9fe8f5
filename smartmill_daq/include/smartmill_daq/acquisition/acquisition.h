#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "smartmill_daq/acquisition/block_maker.h"
#include "smartmill_daq/acquisition/fault_log.h"
#include "smartmill_daq/clock/sample_clock.h"
#include "smartmill_daq/drivers/driver.h"
#include "smartmill_daq/instrument/instrument.h"

namespace smartmill::daq {

/// What has become of an instrument's samples; delivered + lost + estimated_lost + withheld is their number
/// between the first and the last one. The running index begins with the device's own count.
struct SampleAccount {
  std::uint64_t delivered = 0;       ///< [1] in blocks
  std::uint64_t lost = 0;            ///< [1] that the device or its driver has counted
  std::uint64_t estimated_lost = 0;  ///< [1] estimated from the clock, where no counter exists
  std::uint64_t withheld = 0;        ///< [1] while the sample rate was wrong
  std::uint64_t blocks = 0;          ///< [1] of all streams
};

struct InstrumentState {
  bool open = false, silent = false, rate_wrong = false, ended = false;
  std::string problem;  ///< why it is not open
  SampleAccount account;
  ClockState clock;
  std::vector<ChannelLevel> levels;  ///< in the order of Instrument::channels()
  FaultLog faults;                   ///< its counts
};

/// An instrument at work: opens its device, reads it, stamps the samples and passes the blocks on; opens it
/// again when it was lost.
class Acquisition {
 public:
  struct Outputs {
    std::function<void(const Stream&, const SampleBlock&)> block;
    std::function<void(const Fault&)> fault;
  };

  /// @param now [s] the computer's clock that stamps refer to
  Acquisition(Instrument instrument, std::unique_ptr<Driver> driver, Outputs outputs,
              std::function<double()> now);
  ~Acquisition();

  /// Reads at most one batch; waits for it at most a twentieth of a second. To be called again and again by
  /// one thread.
  /// @return false when the device has come to its end. @throws Error on what no waiting repairs.
  bool step();
  /// Passes on what the open blocks hold.
  void finish();

  const Instrument& instrument() const { return instrument_; }
  /// May be called by another thread.
  InstrumentState state() const;

 private:
  using Blocks = std::vector<std::vector<SampleBlock>>;

  void tryToOpen(double now);
  void lose(const std::string& reason, double now);
  void take(RawBatch& batch);
  std::uint64_t place(const RawBatch& batch, std::size_t samples);
  std::uint64_t missingByClock(const RawBatch& batch, std::size_t samples);
  /// [s] end of the last sample of a batch by the device's clock, where it is used, or arrival of the batch.
  double endOf(const RawBatch& batch, std::size_t samples) const;
  /// @param end [s] as endOf()
  void checkRate(const RawBatch& batch, double end);
  void send(const Blocks& blocks);
  double stampOf(std::uint64_t first, std::size_t samples) const;
  void begin(FaultKind kind, double time, const std::string& text);

  const Instrument instrument_;
  std::unique_ptr<Driver> driver_;
  Outputs outputs_;
  std::function<double()> now_;

  mutable std::mutex mutex_;  // of all below
  bool open_ = false, ever_open_ = false, silent_ = false, rate_wrong_ = false, ended_ = false, gone_ = false;
  bool interrupted_ = false;  // before the next batch
  std::string problem_;
  double tried_ = -1e9, heard_ = 0.0;          // [s] last attempt to open, last batch
  std::optional<std::uint64_t> device_index_;  // behind the last sample, as the device counts
  FaultLog log_;
  BlockMaker maker_;
  SampleClock clock_;
  const BlockMaker::StampOf stamp_of_;
  std::uint64_t next_ = 0;    // running index behind the last sample
  double device_time_ = 0.0;  // [s] of the device's clock at device_time_index_
  double device_time_index_ = 0.0;
  double rate_begin_ = -1.0;  // [s] arrival at which counting for the rate began
  std::uint64_t rate_count_ = 0;
  double rate_deviation_ = 0.0;         // [1] of the last count
  std::optional<double> rate_counted_;  // [Hz] if two counts are wrong
  SampleAccount account_;
};

}  // namespace smartmill::daq
