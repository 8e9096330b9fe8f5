#include "smartmill_daq/acquisition/block_maker.h"

#include <cmath>
#include <utility>

namespace smartmill::daq {

BlockMaker::BlockMaker(const Instrument& instrument, bool share_of_range)
    : sample_rate_(instrument.sample_rate),
      length_(static_cast<std::size_t>(std::lround(instrument.block * instrument.sample_rate))) {
  for (const Stream& stream : instrument.streams) {
    SampleBlock& block = open_.emplace_back();
    block.sample_rate = sample_rate_;
    for (const Channel& channel : stream.channels) {
      watches_.emplace_back(channel, sample_rate_, share_of_range);
      block.channels.push_back(channel.name);
      block.units.push_back(channel.unit);
    }
    block.samples.reserve(length_ * block.channels.size());
  }
}

std::vector<std::vector<SampleBlock>> BlockMaker::push(const RawBatch& batch, std::uint64_t first,
                                                       const StampOf& stamp_of, FaultLog& log) {
  std::vector<std::vector<SampleBlock>> out(open_.size());
  if (first != next_) {
    close(stamp_of, &out);
    next_ = first;
  }
  for (std::size_t c = 0; c < watches_.size(); ++c)
    watches_[c].beginBatch(batch.arrival, (batch.overloaded >> c & 1U) != 0,
                           (batch.bias_fault >> c & 1U) != 0);
  const std::size_t samples = batch.values.size() / watches_.size();
  const double* raw = batch.values.data();
  for (std::size_t i = 0; i < samples; ++i) {
    ChannelWatch* watch = watches_.data();
    for (SampleBlock& block : open_) {
      for (std::size_t c = 0; c < block.channels.size(); ++c)
        block.samples.push_back((watch++)->value(*raw++, next_, log));
    }
    ++next_;
    if (++filled_ == length_) close(stamp_of, &out);
  }
  return out;
}

std::vector<std::vector<SampleBlock>> BlockMaker::flush(const StampOf& stamp_of) {
  std::vector<std::vector<SampleBlock>> out(open_.size());
  close(stamp_of, &out);
  return out;
}

void BlockMaker::close(const StampOf& stamp_of, std::vector<std::vector<SampleBlock>>* out) {
  if (filled_ == 0) return;
  const std::uint64_t first = next_ - filled_;
  const double stamp = stamp_of(first, filled_);
  for (std::size_t s = 0; s < open_.size(); ++s) {
    SampleBlock& block = open_[s];
    block.stamp = stamp;
    block.first_index = first;
    SampleBlock next;
    next.sample_rate = sample_rate_;
    next.channels = block.channels;
    next.units = block.units;
    next.samples.reserve(length_ * block.channels.size());
    (*out)[s].push_back(std::exchange(block, std::move(next)));
  }
  filled_ = 0;
}

std::vector<ChannelLevel> BlockMaker::levels() const {
  std::vector<ChannelLevel> all;
  for (const ChannelWatch& watch : watches_) all.push_back(watch.level());
  return all;
}

}  // namespace smartmill::daq
