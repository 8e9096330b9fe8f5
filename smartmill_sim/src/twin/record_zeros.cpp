#include "twin/record_zeros.h"

#include <algorithm>

namespace smartmill::sim {
namespace {

std::size_t samplesWithoutCut(const CampaignTest& test, const Record& recorded) {
  if (test.kind != TestKind::cut) return recorded.size();
  if (!test.engage_time) return 0;
  const auto engaged = std::lower_bound(recorded.time.begin(), recorded.time.end(),
                                        *test.engage_time - 0.5 / test.sample_rate);
  return static_cast<std::size_t>(engaged - recorded.time.begin());
}

}  // namespace

void findZeros(const CampaignTest& test, const Record* recorded, const ChannelRows& raw,
               const SignalStage& signals) {
  const std::vector<RecordZero*> zeros = signals.zeros();
  for (RecordZero* zero : zeros) zero->value = 0.0;
  const std::size_t samples = zeros.empty() || !recorded ? 0 : samplesWithoutCut(test, *recorded);
  if (samples == 0) return;
  ChannelValues sum{};
  for (std::size_t i = 0; i < samples; ++i) {
    ChannelValues values{};
    for (std::size_t c = 0; c < CHANNEL_COUNT; ++c) {
      if (raw[c]) values[c] = (*raw[c])[i];
    }
    signals.apply(static_cast<double>(i) / test.sample_rate, values);
    for (const RecordZero* zero : zeros) {
      const std::size_t c = zero->channel;
      if (raw[c] && recorded->has(channelName(c))) sum[c] += recorded->column(channelName(c))[i] - values[c];
    }
  }
  for (RecordZero* zero : zeros) zero->value = sum[zero->channel] / static_cast<double>(samples);
}

}  // namespace smartmill::sim
