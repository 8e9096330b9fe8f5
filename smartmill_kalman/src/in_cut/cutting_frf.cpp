#include "smartmill_kalman/in_cut/cutting_frf.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include <Eigen/Dense>

#include "smartmill_core/error.h"
#include "smartmill_core/formatted.h"
#include "smartmill_core/signal/statistics.h"

namespace smartmill::kalman {
namespace {

using Complex = std::complex<double>;

/// Weighted mean of lines at one frequency; its standard deviation includes their scatter.
FrfLine merged(const std::vector<FrfLine>& lines) {
  FrfLine sum;
  double weights = 0.0;
  for (const FrfLine& line : lines) {
    const double weight = 1.0 / (line.std_dev * line.std_dev);
    weights += weight;
    sum.frequency += weight * line.frequency;
    sum.value += weight * line.value;
  }
  sum.frequency /= weights;
  sum.value /= weights;
  double chi2 = 0.0;
  for (const FrfLine& line : lines)
    chi2 += std::norm((line.value - sum.value) / line.std_dev) / static_cast<double>(lines.size());
  sum.std_dev = std::sqrt(std::max(1.0, chi2) / weights);
  return sum;
}

FrequencyResponse frfOf(std::vector<FrfLine> lines, const std::string& unit, double same_line) {
  std::sort(lines.begin(), lines.end(),
            [](const FrfLine& a, const FrfLine& b) { return a.frequency < b.frequency; });
  FrequencyResponse frf;
  frf.unit = unit;
  frf.averages = 1;
  for (std::size_t i = 0; i < lines.size();) {
    std::vector<FrfLine> same{lines[i]};
    for (++i; i < lines.size() && lines[i].frequency < same.front().frequency * (1.0 + same_line); ++i)
      same.push_back(lines[i]);
    const FrfLine line = merged(same);
    frf.frequency.push_back(line.frequency);
    frf.value.push_back(line.value);
    frf.std_dev.push_back(line.std_dev);
  }
  return frf;
}

/// Parameters of a mode that depend on the speed.
using Value = double Mode::*;
constexpr Value VALUES[] = {&Mode::frequency, &Mode::damping_ratio, &Mode::gain};
constexpr Value DEVIATIONS[] = {&Mode::frequency_std, &Mode::damping_ratio_std, &Mode::gain_std};
constexpr std::size_t KINDS = 3;

/// Dependence of a mode on the speed around a group of cuts: d ln value / d ln speed.
struct SpeedDependentMode {
  Mode mode;
  double slope[KINDS] = {0.0, 0.0, 0.0}, std_dev[KINDS] = {0.0, 0.0, 0.0};

  /// Correction of the response at f from another speed to that of the group. @param ratio of the speeds
  /// [unit]
  Complex correction(double f, double ratio) const {
    Mode there = mode;
    for (std::size_t k = 0; k < KINDS; ++k) there.*VALUES[k] *= std::pow(ratio, slope[k]);
    return mode.response(f) - there.response(f);
  }
};

double meanSpeed(const std::vector<FrfLine>& lines) {
  double sum = 0.0;
  for (const FrfLine& line : lines) sum += line.speed / static_cast<double>(lines.size());
  return sum;
}

/// Removes modes with a gain that is not significant; differences between speeds can produce such modes.
void dropUncertainModes(ModalFit& fit, const CuttingFrfOptions& options) {
  std::vector<Mode>& modes = fit.model.modes;
  const auto unseen = [&](const Mode& m) {
    return !(std::abs(m.gain) > options.least_gain_deviations * m.gain_std);
  };
  if (std::none_of(modes.begin(), modes.end(), unseen)) return;
  for (const Mode& mode : modes)
    if (options.unit_static_gain && unseen(mode)) fit.model.direct += mode.gain;
  modes.erase(std::remove_if(modes.begin(), modes.end(), unseen), modes.end());
  fit.covariance.resize(0, 0);  // of other modes than these
}

/// FRF and fit of one group, lines corrected to the group's mean speed or to the given one.
SpeedFrf fitted(std::vector<FrfLine> lines, const std::vector<SpeedDependentMode>& moving,
                const std::string& unit, const CuttingFrfOptions& options, std::optional<double> speed = {}) {
  SpeedFrf found;
  found.speed = speed.value_or(meanSpeed(lines));
  found.lowest = lines.front().speed;
  found.highest = lines.back().speed;
  for (FrfLine& line : lines)
    for (const SpeedDependentMode& mode : moving)
      line.value += mode.correction(line.frequency, line.speed / found.speed);
  found.frf = frfOf(std::move(lines), unit, options.same_line);
  const auto count = static_cast<int>(found.frf.size());
  if (count < options.least_lines) {
    found.reason = formatted("%d lines, expected at least %d", count, options.least_lines);
    return found;
  }
  ModalFitOptions fit;
  fit.low = options.low;
  fit.high = options.high;
  fit.max_modes = options.max_modes;
  fit.unit_static_gain = options.unit_static_gain;
  fit.positive_gains = true;
  try {
    found.fit = fitModes(found.frf, fit);
    dropUncertainModes(*found.fit, options);
    if (!found.fit->model.modes.empty()) return found;
    found.fit.reset();
    found.reason = "no significant mode";
  } catch (const Error& e) {
    found.reason = e.what();
  }
  return found;
}

/// Mode closest to a frequency, within `same_mode`; null: none.
const Mode* nearest(const SpeedFrf& frf, double frequency, double same_mode) {
  const Mode* best = nullptr;
  if (!frf.fit) return best;
  for (const Mode& mode : frf.fit->model.modes) {
    const double apart = std::abs(std::log(mode.frequency / frequency));
    if (apart < same_mode && (!best || apart < std::abs(std::log(best->frequency / frequency)))) best = &mode;
  }
  return best;
}

/// Slopes of one mode at a group: of the parabola through the values at the nearest three speeds, or of the
/// line through two; zero for a single group.
SpeedDependentMode speedDependentMode(const std::vector<SpeedFrf>& all, std::size_t group, const Mode& mode,
                                      bool receptance, double same_mode) {
  SpeedDependentMode moving;
  moving.mode = mode;
  std::vector<std::pair<double, const Mode*>> neighbours;  // speed over this one, less 1
  for (const SpeedFrf& other : all) {
    if (const Mode* same = nearest(other, mode.frequency, same_mode))
      neighbours.emplace_back(other.speed / all[group].speed - 1.0, same);
  }
  std::sort(neighbours.begin(), neighbours.end(),
            [](const auto& a, const auto& b) { return std::abs(a.first) < std::abs(b.first); });
  neighbours.resize(std::min<std::size_t>(neighbours.size(), 3));
  const auto count = static_cast<Eigen::Index>(neighbours.size());
  if (count < 2) return moving;
  Eigen::MatrixXd powers(count, count);
  for (Eigen::Index i = 0; i < count; ++i)
    for (Eigen::Index j = 0; j < count; ++j)
      powers(i, j) = std::pow(neighbours[static_cast<std::size_t>(i)].first, static_cast<double>(j));
  const Eigen::RowVectorXd share = powers.inverse().row(1);
  // The gains of a force sensor do not depend on the speed: its static gain is 1.
  for (std::size_t k = 0; k < (receptance ? KINDS : KINDS - 1); ++k) {
    for (Eigen::Index i = 0; i < count; ++i) {
      const Mode& at = *neighbours[static_cast<std::size_t>(i)].second;
      moving.slope[k] += share[i] * std::log(at.*VALUES[k]);
      moving.std_dev[k] = std::hypot(moving.std_dev[k], share[i] * (at.*DEVIATIONS[k]) / (at.*VALUES[k]));
    }
  }
  return moving;
}

/// Speed dependence for a group without a fit: that of the nearest group with one.
std::vector<SpeedDependentMode> borrowed(const std::vector<SpeedFrf>& all,
                                         const std::vector<std::vector<SpeedDependentMode>>& moving,
                                         std::size_t group) {
  std::size_t best = all.size();
  const auto apart = [&](std::size_t g) { return std::abs(std::log(all[g].speed / all[group].speed)); };
  for (std::size_t g = 0; g < all.size(); ++g)
    if (all[g].fit && (best == all.size() || apart(g) < apart(best))) best = g;
  if (best == all.size()) return {};
  std::vector<SpeedDependentMode> here = moving[best];
  for (SpeedDependentMode& m : here)
    for (std::size_t k = 0; k < KINDS; ++k)
      m.mode.*VALUES[k] *= std::pow(all[group].speed / all[best].speed, m.slope[k]);
  return here;
}

/// Adds the uncertainty of the slopes to the standard deviations of the modes.
void widenBySlopes(const std::vector<FrfLine>& lines, const std::vector<SpeedDependentMode>& moving,
                   const std::string& unit, const CuttingFrfOptions& options, SpeedFrf& found) {
  if (!found.fit) return;
  std::vector<Mode>& modes = found.fit->model.modes;
  const std::vector<Mode> before = modes;
  for (std::size_t n = 0; n < moving.size() * KINDS; ++n) {
    std::vector<SpeedDependentMode> other = moving;
    SpeedDependentMode& changed = other[n / KINDS];
    if (changed.std_dev[n % KINDS] == 0.0) continue;
    changed.slope[n % KINDS] += changed.std_dev[n % KINDS];
    const SpeedFrf moved = fitted(lines, other, unit, options);
    for (std::size_t m = 0; m < modes.size(); ++m) {
      const Mode* there = nearest(moved, before[m].frequency, options.same_mode);
      for (std::size_t k = 0; there && k < KINDS; ++k)
        modes[m].*DEVIATIONS[k] =
            std::hypot(modes[m].*DEVIATIONS[k], there->*VALUES[k] - before[m].*VALUES[k]);
    }
  }
}

/// Cuts of a group, by their speeds: ranges of lines.
std::vector<std::pair<std::size_t, std::size_t>> cutsOf(const std::vector<FrfLine>& lines,
                                                        double same_speed) {
  std::vector<std::pair<std::size_t, std::size_t>> cuts;
  for (std::size_t i = 0; i < lines.size(); ++i) {
    if (i == 0 || lines[i].speed > lines[i - 1].speed * (1.0 + same_speed)) cuts.emplace_back(i, i);
    cuts.back().second = i + 1;
  }
  return cuts;
}

/// Standard deviations by leaving out each cut in turn (jackknife), where they are larger: a mode's band has
/// few lines, those of one cut are adjacent, and the residual of the fit underestimates their scatter.
void widenByCuts(const std::vector<FrfLine>& lines, const std::vector<SpeedDependentMode>& moving,
                 const std::string& unit, const CuttingFrfOptions& options, SpeedFrf& found) {
  if (!found.fit) return;
  const auto cuts = cutsOf(lines, options.same_speed);
  std::vector<Mode>& modes = found.fit->model.modes;
  if (cuts.size() < options.least_cuts) return;
  std::vector<std::array<std::vector<double>, KINDS>> neighbours(modes.size());
  for (const auto& [from, to] : cuts) {
    std::vector<FrfLine> others;
    for (std::size_t i = 0; i < lines.size(); ++i)
      if (i < from || i >= to) others.push_back(lines[i]);
    // At the mean speed of the whole group.
    const SpeedFrf left = fitted(std::move(others), moving, unit, options, found.speed);
    for (std::size_t m = 0; m < modes.size(); ++m) {
      const Mode* there = nearest(left, modes[m].frequency, options.same_mode);
      for (std::size_t k = 0; there && k < KINDS; ++k) neighbours[m][k].push_back(there->*VALUES[k]);
    }
  }
  for (std::size_t m = 0; m < modes.size(); ++m) {
    for (std::size_t k = 0; k < KINDS; ++k) {
      const std::vector<double>& values = neighbours[m][k];
      if (values.size() < options.least_cuts) continue;
      const auto n = static_cast<double>(values.size());
      const double deviation = (n - 1.0) / std::sqrt(n) * standardDeviation(values);
      modes[m].*DEVIATIONS[k] = std::max(modes[m].*DEVIATIONS[k], deviation);
    }
  }
}

}  // namespace

void CuttingFrfOptions::validate() const {
  const auto check = [](bool good, const char* key, double value) {
    if (!good) throw Error(formatted("%s: %g is out of range", key, value));
  };
  check(low >= 0.0, "low", low);
  check(high > low, "high", high);
  check(part > 0.0, "part", part);
  check(least_signal >= 1.0, "least_signal", least_signal);
  check(speed_width >= 0.0 && speed_width <= 1.0, "speed_width", speed_width);
  check(least_lines >= 4, "least_lines", least_lines);
  check(max_modes >= 1 && max_modes <= 20, "max_modes", max_modes);
}

std::vector<SpeedFrf> cuttingFrfs(std::vector<FrfLine> lines, const std::string& unit,
                                  const CuttingFrfOptions& options) {
  options.validate();
  std::stable_sort(lines.begin(), lines.end(),
                   [](const FrfLine& a, const FrfLine& b) { return a.speed < b.speed; });
  std::vector<std::vector<FrfLine>> groups;
  for (auto begin = lines.begin(); begin != lines.end();) {
    const double most = begin->speed * (1.0 + options.speed_width);
    const auto end = std::find_if(begin, lines.end(), [most](const FrfLine& l) { return l.speed > most; });
    groups.emplace_back(begin, end);
    begin = end;
  }
  std::vector<SpeedFrf> found;
  for (const auto& group : groups) found.push_back(fitted(group, {}, unit, options));
  // Modes also shift within a group; the neighbouring groups give the slopes.
  std::vector<std::vector<SpeedDependentMode>> moving(groups.size());
  for (int pass = 0; pass < options.passes && groups.size() > 1; ++pass) {
    for (std::size_t g = 0; g < groups.size(); ++g) {
      if (!found[g].fit) continue;
      moving[g].clear();
      for (const Mode& mode : found[g].fit->model.modes)
        moving[g].push_back(speedDependentMode(found, g, mode, unit == "m/N", options.same_mode));
    }
    for (std::size_t g = 0; g < groups.size(); ++g)
      if (!found[g].fit) moving[g] = borrowed(found, moving, g);
    for (std::size_t g = 0; g < groups.size(); ++g) found[g] = fitted(groups[g], moving[g], unit, options);
  }
  for (std::size_t g = 0; g < groups.size(); ++g) {
    widenByCuts(groups[g], moving[g], unit, options, found[g]);
    widenBySlopes(groups[g], moving[g], unit, options, found[g]);
  }
  return found;
}

}  // namespace smartmill::kalman
