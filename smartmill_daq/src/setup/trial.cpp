#include "smartmill_daq/setup/trial.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <utility>

#include "smartmill_core/formatted.h"
#include "smartmill_core/signal/statistics.h"
#include "smartmill_daq/acquisition/state_text.h"

namespace smartmill::daq {
namespace {

constexpr double PATIENCE = 2.0;         // [s] for connection, warm-up and delays, as the drivers wait
constexpr std::size_t MOST_FAULTS = 20;  // lines

void addLevels(TriedChannel& tried, const ChannelLevel& level) {
  std::vector<double> measured;
  for (const double value : tried.samples)
    if (std::isfinite(value)) measured.push_back(value);
  const Channel& channel = tried.channel;
  tried.mean = measured.empty() ? NOT_A_NUMBER : mean(measured);
  tried.rms = NOT_A_NUMBER;
  if (!measured.empty()) {
    double squares = 0.0;
    for (const double value : measured) squares += std::pow(value - tried.mean, 2);
    tried.rms = std::sqrt(squares / static_cast<double>(measured.size()));
  }
  for (const double value : measured)
    tried.peak = std::max(tried.peak, std::abs(value * channel.sensitivity + channel.offset) / channel.range);
  tried.clipped = level.clipped;
  if (tried.clipped > 0) tried.peak = 1.0;
  tried.faulty = level.faulty;
}

}  // namespace

Trial tryInstrument(const Instrument& instrument, std::unique_ptr<Driver> driver, double seconds,
                    const std::function<double()>& now) {
  Trial trial;
  std::map<std::string, std::size_t> first;  // channel of each topic
  for (const Stream& stream : instrument.streams) {
    first[stream.topic] = trial.channels.size();
    for (const Channel& channel : stream.channels) trial.channels.push_back({stream.topic, channel, {}});
  }
  const auto wanted = static_cast<std::size_t>(std::ceil(seconds * instrument.sample_rate));
  Acquisition::Outputs outputs;
  outputs.block = [&](const Stream& stream, const SampleBlock& block) {
    for (std::size_t c = 0; c < stream.channels.size(); ++c) {
      std::vector<double>& samples = trial.channels[first[stream.topic] + c].samples;
      for (std::size_t i = 0; i < block.size() && samples.size() < wanted; ++i)
        samples.push_back(block.at(i, c));
    }
  };
  outputs.fault = [&trial](const Fault& fault) {
    if (trial.faults.size() < MOST_FAULTS)
      trial.faults.push_back(std::string(faultName(fault.kind)) + ": " + fault.text);
  };
  const auto complete = [&] { return trial.channels.back().samples.size() >= wanted; };
  Acquisition acquisition(instrument, std::move(driver), outputs, now);
  const double end = now() + seconds + PATIENCE;
  while (!complete() && now() < end && acquisition.step()) {
  }
  if (!complete()) acquisition.finish();
  const InstrumentState state = acquisition.state();
  trial.clock = state.clock;
  for (std::size_t c = 0; c < trial.channels.size(); ++c) addLevels(trial.channels[c], state.levels[c]);
  if (!complete()) {
    const std::size_t came = trial.channels.back().samples.size();
    trial.problem = came == 0 || !isWell(state)
                        ? summaryOf(state)
                        : formatted("%zu samples in %.3g s, expected %zu", came, seconds + PATIENCE, wanted);
  }
  return trial;
}

}  // namespace smartmill::daq
