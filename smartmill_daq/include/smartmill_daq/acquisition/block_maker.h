#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <vector>

#include "smartmill_core/signal/streams.h"
#include "smartmill_daq/acquisition/channel_watch.h"
#include "smartmill_daq/acquisition/fault_log.h"
#include "smartmill_daq/drivers/driver.h"
#include "smartmill_daq/instrument/instrument.h"

namespace smartmill::daq {

/// Cuts the samples of an instrument into blocks of its streams. A block has no samples missing within;
/// before a gap it is cut short. Samples that are no measurement are NaN in their channel.
class BlockMaker {
 public:
  /// Stamp [s] of a block by the running index of its first sample and its length.
  using StampOf = std::function<double(std::uint64_t first, std::size_t samples)>;

  BlockMaker(const Instrument& instrument, bool share_of_range);

  /// @param first running index of the batch's first sample: behind the last one, or beyond after a gap
  /// @param stamp_of for the blocks that become complete @return by stream, in the order of their samples
  std::vector<std::vector<SampleBlock>> push(const RawBatch& batch, std::uint64_t first,
                                             const StampOf& stamp_of, FaultLog& log);
  /// What the open blocks hold, before an interruption.
  std::vector<std::vector<SampleBlock>> flush(const StampOf& stamp_of);

  std::uint64_t next() const { return next_; }  ///< running index behind the last sample
  std::size_t inputs() const { return watches_.size(); }
  std::vector<ChannelLevel> levels() const;

 private:
  void close(const StampOf& stamp_of, std::vector<std::vector<SampleBlock>>* out);

  double sample_rate_;
  std::size_t length_;  // [1] samples of a block
  std::vector<ChannelWatch> watches_;
  std::vector<SampleBlock> open_;  // by stream
  std::size_t filled_ = 0;         // samples in the open blocks
  std::uint64_t next_ = 0;
};

}  // namespace smartmill::daq
