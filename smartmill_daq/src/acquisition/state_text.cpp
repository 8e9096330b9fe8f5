#include "smartmill_daq/acquisition/state_text.h"

#include "smartmill_core/formatted.h"

namespace smartmill::daq {
namespace {

constexpr double PPM = 1e-6, US = 1e-6;

unsigned long long wide(std::uint64_t number) {
  return number;
}

}  // namespace

bool isWell(const InstrumentState& state) {
  return state.open && !state.silent && !state.rate_wrong;
}

std::string summaryOf(const InstrumentState& state) {
  if (state.ended) return "the device has come to its end";
  if (!state.open) return state.problem.empty() ? "not open yet" : state.problem;
  if (state.silent) return "no samples";
  if (state.rate_wrong) return "wrong sample rate, no blocks";
  for (const ChannelLevel& level : state.levels) {
    if (level.faulty) return "a channel is no measurement";
  }
  return "measuring";
}

std::string clockText(const ClockState& clock) {
  return formatted("drift %+.2f ppm (sd %.2f), offset %+.6f s (sd %.1f us), jitter %.0f us",
                   clock.drift / PPM, clock.drift_std / PPM, clock.offset, clock.offset_std / US,
                   clock.jitter / US);
}

std::string faultText(const FaultLog& faults) {
  std::vector<std::string> texts;
  for (std::size_t kind = 0; kind < FAULT_KINDS; ++kind) {
    const FaultLog::Count& count = faults.count(static_cast<FaultKind>(kind));
    if (count.events > 0)
      texts.push_back(formatted("%llu %s (%llu samples)", wide(count.events),
                                faultName(static_cast<FaultKind>(kind)), wide(count.samples)));
  }
  return joined(texts);
}

std::string levelText(const Channel& channel, const ChannelLevel& level) {
  return formatted("%s: mean %.4g %s, rms %.4g %s, peak %.1f %% of the range, %llu clipped%s",
                   channel.name.c_str(), level.mean, channel.unit.c_str(), level.rms, channel.unit.c_str(),
                   100.0 * level.peak, wide(level.clipped), level.faulty ? ", no measurement now" : "");
}

}  // namespace smartmill::daq
