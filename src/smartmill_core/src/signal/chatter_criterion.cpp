#include "smartmill_core/signal/chatter_criterion.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include "smartmill_core/signal/spectral_lines.h"

namespace smartmill {
namespace {

/// [lines] Strongest line.
double strongest(const std::vector<double>& power) {
  return peakPosition(
      power, static_cast<std::size_t>(std::max_element(power.begin() + 1, power.end() - 1) - power.begin()));
}

/// [1] Natural logarithm of a ratio, limited.
double marginOf(double ratio) {
  constexpr double MOST = ChatterEvidence::LARGEST_MARGIN;
  return ratio > 0.0 ? std::clamp(std::log(ratio), -MOST, MOST) : -MOST;
}

/// [1] Of a part in a whole over a limit of their ratio, by the part over the rest: as far from the limit at
/// 0 as at 1.
double marginOf(double part, double whole, double limit) {
  const double rest = whole - part;
  return rest > 0.0 ? marginOf(part / rest * (1.0 - limit) / limit) : ChatterEvidence::LARGEST_MARGIN;
}

}  // namespace

std::vector<ChatterCriterion::Line> ChatterCriterion::lines(const RevolutionWindow& window, double period,
                                                            const std::vector<double>& background,
                                                            ChatterEvidence::Reason& reason) const {
  const std::vector<double>& power = window.power();
  const std::vector<double> floor = noiseFloor(power, options_.floor_reach);
  const auto turns = static_cast<double>(window.turns());
  const std::size_t edge = options_.skirt_distance + 2;
  const auto levelAt = [&](std::size_t k) { return (power[k - 1] + power[k] + power[k + 1]) / 3.0; };
  std::vector<Line> found;
  for (std::size_t k = edge; k + edge < power.size(); ++k) {
    const double p = power[k];
    const double frequency = static_cast<double>(k) / turns / period;
    if (frequency < options_.lowest_frequency || frequency > options_.highest_frequency) continue;
    if (!(p > options_.over_floor * floor[k]) || p < power[k - 1] || p < power[k + 1]) continue;
    // Another line may be present on one side.
    if (std::min(levelAt(k - options_.skirt_distance), levelAt(k + options_.skirt_distance)) >
        options_.narrowness * p)
      continue;
    Line line;
    line.position = peakPosition(power, k);
    if (options_.speed_error > 0.0 && std::abs(std::remainder(line.position, turns)) <
                                          options_.companion_error + options_.speed_error * line.position)
      continue;
    if (std::any_of(options_.ignored.begin(), options_.ignored.end(), [&](double known) {
          return std::abs(known * period * turns - line.position) <
                 options_.companion_error + options_.speed_error * line.position + 1.0;
        }))
      continue;
    line.over_floor = p / floor[k];
    if (!background.empty()) {
      line.over_background = p / std::max({background[k - 1], background[k], background[k + 1],
                                           std::numeric_limits<double>::min()});
      if (line.over_background < options_.over_background) {
        reason = std::max(reason, ChatterEvidence::Reason::in_background);
        continue;
      }
    }
    // A growing vibration widens its line: down to the next minimum.
    line.power = p - floor[k];
    for (const int side : {-1, 1}) {
      for (std::size_t d = 1, before = k; d <= options_.skirt_distance; ++d) {
        const std::size_t at = side < 0 ? k - d : k + d;
        if (power[at] > power[before] || power[at] < floor[at]) break;
        line.power += power[at] - floor[at];
        before = at;
      }
    }
    found.push_back(line);
  }
  return found;
}

double ChatterCriterion::modeNear(double frequency) const {
  for (const double mode : options_.modes)
    if (frequency >= (1.0 - options_.below_mode) * mode && frequency <= (1.0 + options_.above_mode) * mode)
      return mode;
  return ChatterEvidence::UNKNOWN;
}

ChatterCriterion::Family ChatterCriterion::familyOf(const Line& line, const std::vector<Line>& lines,
                                                    const RevolutionWindow& window, double period) const {
  const auto turns = static_cast<double>(window.turns());
  const double teeth = std::max(1, window.teeth()), farthest = options_.companion_passings * teeth;
  const bool measured_angle = !(options_.speed_error > 0.0);
  const auto modeOf = [&](const Line& of) { return modeNear(of.position / turns / period); };
  Family family;
  family.strongest = line;
  family.power = line.power;
  family.mode = modeOf(line);
  for (const Line& other : lines) {
    if (other.position == line.position || other.power < options_.least_companion * line.power) continue;
    bool member = false;
    // A real signal has the mirrored lines too.
    for (const double sign : {1.0, -1.0}) {
      const double distance = (other.position - sign * line.position) / turns;
      const double revolutions = std::abs(std::round(distance));
      const double error = options_.companion_error + options_.speed_error * other.position;
      if (std::abs(distance - std::round(distance)) * turns > error) continue;
      const bool next = revolutions == 1.0 || revolutions == teeth;
      family.one_passing = family.one_passing || revolutions == teeth;
      family.one_revolution += revolutions == 1.0;
      if (sign > 0.0 && revolutions == 1.0) (distance > 0.0 ? family.above : family.below) = other.power;
      // Unequal teeth add all multiples of a revolution, which coincide by chance unless the angle is
      // measured.
      const bool near = measured_angle ? std::abs(other.position - line.position) <= farthest * turns
                                       : std::fmod(revolutions, teeth) == 0.0 && revolutions <= farthest;
      member = member || next || near;
    }
    if (!member) continue;
    ++family.companions;
    family.power += other.power;
    if (other.power > family.strongest.power) family.strongest = other;
    if (std::isnan(family.mode)) family.mode = modeOf(other);
  }
  return family;
}

ChatterCriterion::Family ChatterCriterion::strongestFamily(const RevolutionWindow& window, double period,
                                                           const std::vector<double>& background,
                                                           const Energies& energies,
                                                           ChatterEvidence::Reason& reason) const {
  using Reason = ChatterEvidence::Reason;
  const std::vector<Line> all = lines(window, period, background, reason);
  Family best;
  for (const Line& line : all) {
    const Family family = familyOf(line, all, window, period);
    if (!options_.modes.empty() && std::isnan(family.mode)) {
      reason = Reason::far_from_modes;
    } else if (family.power > best.power) {
      best = family;
    }
  }
  if (!(best.power > 0.0)) return {};
  best = familyOf(best.strongest, all, window, period);
  best.margin = std::max(marginOf(best.power, energies.total, options_.energy_ratio),
                         marginOf(best.power, energies.remainder, options_.whole));
  if (best.margin <= 0.0) {
    reason = std::max(reason, Reason::weak);
    return best;
  }
  if (background.empty() && !best.isModulated()) {
    best.margin = std::min(best.margin, marginOf(best.power, energies.remainder, options_.dominance));
    if (best.margin <= 0.0) {
      reason = std::max(reason, Reason::single);
      return best;
    }
  }
  reason = Reason::none;
  return best;
}

double ChatterCriterion::persistence(const RevolutionWindow& window) const {
  const std::vector<double>& turns = window.remainderOfTurn();
  const auto middle = turns.begin() + static_cast<std::ptrdiff_t>((turns.size() + 1) / 2);
  const double early =
      std::accumulate(turns.begin(), middle, 0.0) / static_cast<double>(middle - turns.begin());
  const double late = std::accumulate(middle, turns.end(), 0.0) / static_cast<double>(turns.end() - middle);
  return late / std::max(options_.decay * early, std::numeric_limits<double>::min());
}

double ChatterCriterion::powerInBand(const RevolutionWindow& window, double period) const {
  double power = 0.0;
  for (std::size_t k = 0; k < window.power().size(); ++k) {
    const double frequency = static_cast<double>(k) / static_cast<double>(window.turns()) / period;
    if (frequency >= options_.lowest_frequency && frequency <= options_.highest_frequency)
      power += window.power()[k];
  }
  return power;
}

ChatterEvidence ChatterCriterion::judge(const RevolutionWindow& window, double period,
                                        const std::vector<double>& background) const {
  using Reason = ChatterEvidence::Reason;
  const double all = std::accumulate(window.power().begin(), window.power().end(), 0.0);
  const double share = all > 0.0 ? powerInBand(window, period) / all : 0.0;
  const double remainder = share * window.remainder();
  const double total = std::max(0.0, window.total() - (1.0 - share) * window.remainder());
  ChatterEvidence evidence;
  // Without the correction for the part of the remainder that is in the mean.
  const double kept = 1.0 - 1.0 / static_cast<double>(window.turns());
  evidence.synchronous = std::max(0.0, window.total() - kept * window.remainder());
  evidence.alternation = total > 0.0 ? std::min(1.0, window.alternating() / total) : 0.0;
  // In a flip every second tooth cuts alike; a lost tooth or runout has its energy mostly at other orders.
  evidence.flip = evidence.alternation > options_.alternation_ratio && window.alternating() > remainder &&
                  window.alternating() > options_.alternation_purity * window.unequal();
  const double energy = evidence.flip ? remainder + window.alternating() : remainder;
  evidence.energy_ratio = total > 0.0 ? std::min(1.0, energy / total) : 0.0;
  evidence.severity = std::sqrt(energy);
  const auto turns = static_cast<double>(window.turns());
  evidence.order = evidence.flip ? window.strongestFlipOrder() : strongest(window.power()) / turns;
  evidence.margin = marginOf(evidence.energy_ratio, 1.0, options_.energy_ratio);
  if (options_.least_severity > 0.0)
    evidence.margin = std::min(evidence.margin, marginOf(energy / std::pow(options_.least_severity, 2)));
  const bool weak = evidence.margin <= 0.0;
  if (evidence.flip && !weak) {
    evidence.margin = std::min(evidence.margin, marginOf(evidence.alternation / options_.alternation_ratio));
    // It is synchronous: within this window it is present from the start.
    evidence.chatter = true;
    evidence.reason = Reason::none;
    return evidence;
  }
  if (const double persists = persistence(window); persists < 1.0) {
    evidence.margin = std::min(evidence.margin, marginOf(persists));
    evidence.reason = weak ? Reason::weak : Reason::decays;
    return evidence;
  }
  // The taper of the spectrum suppresses the ends of the window, where growing chatter and chatter near a
  // harmonic are largest. With an estimated angle what is near a harmonic is the error of the estimate.
  const double scale = options_.speed_error > 0.0 ? 1.0 : window.remainder() / all;
  const Family family =
      strongestFamily(window, period, background, {total / scale, remainder / scale}, evidence.reason);
  evidence.margin = std::min(evidence.margin, family.margin);
  if (weak) evidence.reason = Reason::weak;
  evidence.modulated = family.one_passing;
  evidence.companions = family.companions;
  evidence.like_bearing = family.isLikeBearing();
  if (evidence.margin <= 0.0) return evidence;
  evidence.chatter = true;
  evidence.order = family.strongest.position / turns;
  evidence.line_power = scale * family.strongest.power;
  evidence.power = scale * family.power;
  evidence.over_floor = family.strongest.over_floor;
  evidence.over_background = family.strongest.over_background;
  evidence.mode = family.mode;
  evidence.onset = window.turns() - 1;
  while (evidence.onset > 0 && window.remainderOfTurn()[evidence.onset - 1] > options_.energy_ratio * total)
    --evidence.onset;
  return evidence;
}

}  // namespace smartmill
