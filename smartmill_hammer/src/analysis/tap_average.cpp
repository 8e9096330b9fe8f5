#include <algorithm>
#include <cmath>
#include <complex>
#include <limits>

#include "response_kind.h"
#include "smartmill_core/error.h"
#include "smartmill_core/formatted.h"
#include "smartmill_core/modal/impact_analysis.h"
#include "smartmill_core/signal/statistics.h"
#include "smartmill_core/units.h"
#include "smartmill_hammer/analysis/tap_records.h"

namespace smartmill::hammer {
namespace {

/// By ResponseKind.
constexpr const char* RESPONSE_NAMES[] = {"acceleration", "velocity", "displacement", "force"};
constexpr const char* FRF_UNITS[] = {"m/s2/N", "m/s/N", "m/N", "1"};

/// Whether the response has not decayed at the end: its last tenth compared with the first after the hit.
bool isTruncated(const Hit& hit, const TapFrfOptions& options) {
  const std::size_t quiet = hit.pre_trigger - hit.pre_trigger / 4,
                    tenth = (hit.response.size() - hit.pre_trigger) / 10;
  if (tenth < LEAST_QUIET_SAMPLES) return false;
  const auto scatter = [&](std::size_t from, std::size_t count) {
    const auto begin = hit.response.begin() + static_cast<std::ptrdiff_t>(from);
    return standardDeviation({begin, begin + static_cast<std::ptrdiff_t>(count)});
  };
  const double noise = quiet < LEAST_QUIET_SAMPLES ? 0.0 : scatter(0, quiet);
  const double first = scatter(hit.pre_trigger, tenth), last = scatter(hit.response.size() - tenth, tenth);
  return last > std::hypot(options.clear_of_noise * noise, options.ringing_share * first);
}

/// The record from just before the hit on, baselines subtracted.
Hit fromHit(const Hit& hit, std::size_t lead_samples) {
  Hit cut = hit;
  const auto peak =
      static_cast<std::size_t>(std::max_element(hit.force.begin(), hit.force.end()) - hit.force.begin());
  const std::size_t lead = std::min(hit.pre_trigger, peak - hit.pre_trigger + lead_samples);
  const std::size_t quiet = hit.pre_trigger - hit.pre_trigger / 4;
  for (std::vector<double>* channel : {&cut.force, &cut.response}) {
    const auto begin = channel->begin();
    const double base =
        quiet < LEAST_QUIET_SAMPLES ? 0.0 : mean({begin, begin + static_cast<std::ptrdiff_t>(quiet)});
    channel->erase(begin, begin + static_cast<std::ptrdiff_t>(hit.pre_trigger - lead));
    for (double& value : *channel) value -= base;
  }
  cut.pre_trigger = lead;
  return cut;
}

/// Truncated records begin with the hit and get the length of the shortest. @return [s] that length
double cutToHits(std::vector<Hit>& hits, std::size_t lead_samples) {
  std::size_t shortest = std::numeric_limits<std::size_t>::max();
  for (Hit& hit : hits) {
    hit = fromHit(hit, lead_samples);
    shortest = std::min(shortest, hit.force.size());
  }
  for (Hit& hit : hits) {
    hit.force.resize(shortest);
    hit.response.resize(shortest);
  }
  return static_cast<double>(shortest) / hits.front().sample_rate;
}

}  // namespace

std::string nameOf(ResponseKind kind) {
  return RESPONSE_NAMES[static_cast<std::size_t>(kind)];
}

std::string frfUnit(ResponseKind kind) {
  return FRF_UNITS[static_cast<std::size_t>(kind)];
}

FrequencyResponse receptanceOf(const FrequencyResponse& measured, ResponseKind kind) {
  if (kind == ResponseKind::acceleration) return receptanceFromAccelerance(measured);
  FrequencyResponse receptance = measured;
  if (kind != ResponseKind::velocity) return receptance;
  receptance.unit = "m/N";
  for (std::size_t i = 0; i < receptance.size(); ++i) {
    const double w = units::TWO_PI * receptance.frequency[i];
    receptance.value[i] /= std::complex<double>(0.0, w);
    if (!receptance.std_dev.empty()) receptance.std_dev[i] /= w;
  }
  return receptance;
}

TapFrf averageTaps(const std::vector<TapRecord>& taps, const TapFrfOptions& options) {
  if (taps.empty()) throw Error("no hit was given");
  TapFrf result;
  std::vector<Hit> hits;
  for (const TapRecord& tap : taps) {
    if (tap.kind != taps.front().kind) {
      throw Error(tap.file + ": " + nameOf(tap.kind) + ", but " + taps.front().file + " contains " +
                  nameOf(taps.front().kind));
    }
    hits.push_back(tap.hit);
  }
  const std::vector<HitFault> faults = checkHits(hits, options.check);
  ImpactOptions impact;
  impact.exponential_time = options.exponential_time;
  impact.unit = frfUnit(taps.front().kind);
  std::vector<Hit> accepted;
  for (std::size_t i = 0; i < taps.size(); ++i) {
    result.hits.push_back({taps[i].file, faults[i].text});
    if (!result.hits[i].accepted()) continue;
    if (!accepted.empty() && (hits[i].force.size() != accepted.front().force.size() ||
                              hits[i].sample_rate != accepted.front().sample_rate)) {
      throw Error(formatted("%s: %zu samples at %g Hz, expected the length and rate of the previous hits",
                            taps[i].file.c_str(), hits[i].force.size(), hits[i].sample_rate));
    }
    accepted.push_back(hits[i]);
  }
  if (accepted.empty()) return result;
  if (options.exponential_time == 0.0 &&
      std::any_of(accepted.begin(), accepted.end(),
                  [&options](const Hit& hit) { return isTruncated(hit, options); }))
    result.truncated_length = cutToHits(accepted, options.lead_samples);
  ImpactAnalysis analysis(impact);
  for (const Hit& hit : accepted) analysis.add(hit);
  result.measured = analysis.frf(options.average).band(1e-9, INFINITY);
  result.receptance = receptanceOf(result.measured, taps.front().kind);
  return result;
}

void correctTruncation(std::vector<EstimatedMode>& modes, double truncated_length) {
  using Complex = std::complex<double>;
  if (!(truncated_length > 0.0)) return;
  for (EstimatedMode& m : modes) {
    const double w = units::TWO_PI * m.frequency, phase = w * truncated_length;
    const Complex truncation =
        std::exp(phase * Complex(-m.damping_ratio, std::sqrt(1.0 - m.damping_ratio * m.damping_ratio)));
    const Complex share = 1.0 - truncation;
    const double by_pole =
        std::abs(truncation / share) * phase * std::hypot(m.frequency_std / m.frequency, m.damping_ratio_std);
    for (std::size_t o = 0; o < m.gain.size(); ++o) {
      const Complex whole = Complex(m.gain[o], m.phase_part[o]) / share;
      const double by_share = by_pole * std::abs(whole);
      m.gain[o] = whole.real();
      m.phase_part[o] = whole.imag();
      m.gain_std[o] = std::hypot(m.gain_std[o] / std::abs(share), by_share);
      m.phase_part_std[o] = std::hypot(m.phase_part_std[o] / std::abs(share), by_share);
    }
  }
}

}  // namespace smartmill::hammer
