#include "smartmill_discrepancy/gap/campaign_channels.h"

#include <algorithm>
#include <numeric>
#include <utility>

namespace smartmill::discrepancy {
namespace {

// Means of the simulated values at the times of a slow channel.
std::vector<double> meansAt(const SlowMeans& slow, const std::vector<double>& values, double sample_rate) {
  std::vector<double> means;
  for (const std::vector<double>& times : slow.times) {
    double sum = 0.0;
    for (const double t : times) {
      const double at = std::min(t * sample_rate, static_cast<double>(values.size() - 1));
      const auto before = static_cast<std::size_t>(at);
      const double share = at - static_cast<double>(before);
      sum += (1.0 - share) * values[before] + share * values[std::min(before + 1, values.size() - 1)];
    }
    means.push_back(sum / static_cast<double>(times.size()));
  }
  return means;
}

}  // namespace

std::vector<double> valuesOf(const std::vector<double>& all, const ChannelSpan& span) {
  const auto from = all.begin() + static_cast<std::ptrdiff_t>(span.offset);
  return {from, from + static_cast<std::ptrdiff_t>(span.size)};
}

CampaignChannels::CampaignChannels(const Dataset& data, const std::vector<std::size_t>& tests) : data_(data) {
  const auto add = [&](std::size_t test, const std::string& channel, const std::vector<double>& values,
                       double noise, const SlowMeans* slow) {
    spans_.push_back({test, channel, size_, values.size(), noise, slow, !data.tests[test].chatter});
    size_ += values.size();
    for (const double v : values) measured_.push_back(v / noise);
  };
  for (const std::size_t t : tests) {
    const TestData& test = data.tests[t];
    first_span_.push_back(spans_.size());
    for (const std::string& channel : test.channels)
      add(t, channel, test.record.column(channel), data.noise.at(channel), nullptr);
    for (const SlowMeans& slow : test.slow) add(t, slow.channel, slow.mean, slow.noise, &slow);
  }
  first_span_.push_back(spans_.size());
}

double CampaignChannels::effectiveSamples() const {
  return std::accumulate(spans_.begin(), spans_.end(), 0.0,
                         [](double sum, const ChannelSpan& b) { return sum + b.effective_samples; });
}

std::vector<double> CampaignChannels::normalised(std::size_t span, std::vector<double> values) const {
  const ChannelSpan& b = spans_[span];
  if (b.slow) values = meansAt(*b.slow, values, data_.tests[b.test].test.sample_rate);
  for (double& v : values) v /= b.noise;
  if (!whitening_.empty()) whitening_[span].apply(values.data(), values.size());
  return values;
}

bool CampaignChannels::readWeights(std::size_t chosen) {
  bool changed = false;
  for (std::size_t b = begin(chosen); b < end(chosen); ++b) changed = readWeight(spans_[b]) || changed;
  return changed;
}

// @return whether it changed
bool CampaignChannels::readWeight(ChannelSpan& span) {
  const TestData& test = data_.tests[span.test];
  const auto found = test.weights.find(span.channel);
  const ChannelWeight trust = test.guided && found != test.weights.end() ? found->second : ChannelWeight{};
  span.effective_samples = trust.samples * static_cast<double>(span.size);
  const double noise = trust.noise * (span.slow ? span.slow->noise : data_.noise.at(span.channel));
  if (noise == span.noise) return false;
  for (std::size_t i = span.offset; i < span.offset + span.size; ++i) measured_[i] *= span.noise / noise;
  span.noise = noise;
  return true;
}

bool CampaignChannels::setWhitening(std::vector<Whitening> of_spans) {
  if (of_spans.empty() && whitening_.empty()) return false;
  whitening_ = std::move(of_spans);
  whitenRecords();
  return true;
}

void CampaignChannels::whitenRecords() {
  whitened_.clear();
  if (whitening_.empty()) return;
  whitened_ = measured_;
  for (std::size_t b = 0; b < spans_.size(); ++b)
    whitening_[b].apply(whitened_.data() + spans_[b].offset, spans_[b].size);
}

}  // namespace smartmill::discrepancy
