#pragma once

#include <cstddef>
#include <memory>
#include <string>
#include <vector>

#include "smartmill_discrepancy/data/dataset.h"
#include "smartmill_discrepancy/gap/whitening.h"

namespace smartmill::discrepancy {

/// Position of one channel of a test in a vector over the campaign.
struct ChannelSpan {
  std::size_t test = 0;
  std::string channel;
  std::size_t offset = 0;
  std::size_t size = 0;
  double noise = 0.0;               ///< [unit of the channel]
  const SlowMeans* slow = nullptr;  ///< values are these means instead of the record's samples
  bool in_gap = true;               ///< false: a chattering cut, which is fitted but takes no part in gaps
  double effective_samples = 0.0;   ///< [samples] that count as independent
};

/// The values of a span in a vector over the campaign.
std::vector<double> valuesOf(const std::vector<double>& all, const ChannelSpan& span);

/// Simulated values over the noise, one vector per span. Models share the vectors of spans that their
/// differences do not affect.
using SimulatedChannels = std::vector<std::shared_ptr<const std::vector<double>>>;

/// Layout of vectors over a campaign, all channels of the chosen tests one after the other, each over its
/// noise, and the records in this layout.
class CampaignChannels {
 public:
  /// @param data must outlive this object @param tests indices into data.tests
  CampaignChannels(const Dataset& data, const std::vector<std::size_t>& tests);

  const std::vector<ChannelSpan>& spans() const { return spans_; }
  /// First span of a chosen test, and first span after it.
  std::size_t begin(std::size_t chosen) const { return first_span_[chosen]; }
  std::size_t end(std::size_t chosen) const { return first_span_[chosen + 1]; }
  std::size_t size() const { return size_; }
  /// [samples] that count as independent: less than size() if channels have reduced weights.
  double effectiveSamples() const;

  /// The records, whitened like the simulations.
  const std::vector<double>& measured() const { return whitened_.empty() ? measured_ : whitened_; }
  /// Simulated values of a span, from those of its channel at the samples of the record.
  std::vector<double> normalised(std::size_t span, std::vector<double> values) const;

  /// Reads the weights of a test again; whitenRecords() follows the last test. @return whether they changed
  bool readWeights(std::size_t chosen);
  void whitenRecords();
  /// Filters, one per span or none at all. @return false, without change: there are none before and after
  bool setWhitening(std::vector<Whitening> of_spans);

 private:
  bool readWeight(ChannelSpan& span);

  const Dataset& data_;
  std::vector<ChannelSpan> spans_;
  std::vector<std::size_t> first_span_;  // by chosen test; one more at the end
  std::size_t size_ = 0;
  std::vector<double> measured_;
  std::vector<Whitening> whitening_;  // by span; empty: none
  std::vector<double> whitened_;      // the filtered records; empty: not filtered
};

}  // namespace smartmill::discrepancy
