#include "modal_search.h"

#include <algorithm>
#include <cmath>

#include "smartmill_core/signal/statistics.h"

namespace smartmill {
namespace {

using Complex = std::complex<double>;
using Eigen::Index;

/// Reach of a window on either side of its modes: in half widths, and least number of lines.
constexpr double REACH = 8.0, LEAST_LINES = 20.0;
/// Modes nearer than this multiple of their half widths are fitted together.
constexpr double TOGETHER = 4.0;
constexpr std::size_t MOST_TOGETHER = 6, MOST_AT_START = 32;
/// Least distance of a mode from the ends of the band, in lines and in half widths: a truncated peak is not
/// significant.
constexpr double FROM_END = 2.5, HALF_WIDTHS_FROM_END = 1.5;
/// Largest damping ratio: wider peaks are indistinguishable from the background parabola.
constexpr double WIDEST_DAMPING = 0.25;
constexpr std::size_t MOST_TRIES = 20;
/// A peak with this multiple of the magnitude around it is a mode whatever its phase.
constexpr double CLEAR_PEAK = 12.0;
constexpr std::size_t ABOUT = 50;
/// Number of damping ratios of the average for a mode fitted to the magnitude.
constexpr int DAMPINGS = 120;
/// Evidence from which a mode is significant; above 1 because the misfit of real records is not uniform
/// noise. Above the second value it stays in the fit as a doubt, so that its share does not count as misfit
/// of the others.
constexpr double PROVEN = 2.5, DOUBTFUL = 0.35;
/// Least relative distance of start values; nearer ones are duplicates.
constexpr double DUPLICATE = 0.02;
constexpr int STEPS = 8, LAST_STEPS = 25;
constexpr double ROUGHLY = 1e-4, CLOSELY = 1e-8;  // relative change of the squares that ends a fit
/// Lines per half width for the search and for the last fit; more lines are averaged in groups.
constexpr double SEARCH_LINES = 6.0, FIT_LINES = 40.0;

/// Weighted averages over groups of lines.
WeightedLines thinned(const WeightedLines& lines, std::size_t group) {
  if (group < 2) return lines;
  WeightedLines result;
  const std::size_t groups = lines.size() / group;
  for (std::size_t o = 0; o < lines.frfs(); ++o) {
    std::vector<Complex> value;
    std::vector<double> weight;
    result.frequency.clear();
    for (std::size_t g = 0; g < groups; ++g) {
      Complex sum;
      double squares = 0.0, along = 0.0;
      for (std::size_t i = g * group; i < (g + 1) * group; ++i) {
        const double square = lines.weight[o][i] * lines.weight[o][i];
        sum += square * lines.value[o][i];
        squares += square;
        along += lines.frequency[i];
      }
      value.push_back(sum / squares);
      weight.push_back(std::sqrt(squares));
      result.frequency.push_back(along / static_cast<double>(group));
    }
    result.value.push_back(std::move(value));
    result.weight.push_back(std::move(weight));
  }
  return result;
}

EstimatedMode describe(const ModalWindow& window, const WindowFit& f, Index k) {
  const Index per = window.sharesPerMode();
  const double scale = std::sqrt(f.variance[static_cast<std::size_t>(k)]);
  EstimatedMode m;
  m.frequency = f.poles.frequency(k);
  m.damping_ratio = f.poles.damping(k);
  m.frequency_std = m.frequency * scale * std::sqrt(f.pole_covariance(2 * k, 2 * k));
  m.damping_ratio_std = m.damping_ratio * scale * std::sqrt(f.pole_covariance(2 * k + 1, 2 * k + 1));
  for (std::size_t o = 0; o < f.frfs.size(); ++o) {
    m.gain.push_back(f.frfs[o].share[k * per]);
    m.gain_std.push_back(scale * std::sqrt(f.covariance[o](k * per, k * per)));
    m.phase_part.push_back(per == 2 ? f.frfs[o].share[k * per + 1] : 0.0);
    m.phase_part_std.push_back(per == 2 ? scale * std::sqrt(f.covariance[o](k * per + 1, k * per + 1)) : 0.0);
  }
  m.evidence = f.evidence[static_cast<std::size_t>(k)];
  return m;
}

}  // namespace

ModalSearch::ModalSearch(const WeightedLines& lines, const ModalEstimateOptions& options)
    : lines_(lines), options_(options), residual_(lines.value) {
}

bool ModalSearch::reportProgress(double share) const {
  return !options_.progress || options_.progress(share);
}

double ModalSearch::reach(double frequency, double damping) const {
  return std::max(REACH * damping * frequency, LEAST_LINES * lines_.step());
}

bool ModalSearch::inBand(double frequency, double damping) const {
  const double margin = std::max(FROM_END * lines_.step(), HALF_WIDTHS_FROM_END * damping * frequency);
  return frequency > lines_.frequency.front() + margin && frequency < lines_.frequency.back() - margin;
}

ModalSearch::Span ModalSearch::spanOf(const std::vector<EstimatedMode>& members) const {
  double low = lines_.frequency.back(), high = lines_.frequency.front();
  for (const EstimatedMode& m : members) {
    low = std::min(low, m.frequency - reach(m.frequency, m.damping_ratio));
    high = std::max(high, m.frequency + reach(m.frequency, m.damping_ratio));
  }
  const auto begin = lines_.frequency.begin(), end = lines_.frequency.end();
  Span span{static_cast<std::size_t>(std::lower_bound(begin, end, low) - begin),
            static_cast<std::size_t>(std::upper_bound(begin, end, high) - begin)};
  // At the ends of the band the window keeps its number of lines.
  const auto least = static_cast<std::size_t>(2.0 * LEAST_LINES);
  if (span.last - span.first < least) {
    span.last = std::min(lines_.size(), span.first + least);
    span.first = span.last > least ? std::min(span.first, span.last - least) : 0;
  }
  return span;
}

std::vector<std::size_t> ModalSearch::neighbours(double frequency, double damping) const {
  const double width = std::max(damping * frequency, 2.0 * lines_.step());
  std::vector<std::pair<double, std::size_t>> near;
  for (std::size_t k = 0; k < modes_.size(); ++k) {
    const EstimatedMode& m = modes_[k];
    const double far = std::abs(m.frequency - frequency) /
                       (width + std::max(m.damping_ratio * m.frequency, 2.0 * lines_.step()));
    if (far < TOGETHER) near.emplace_back(far, k);
  }
  std::sort(near.begin(), near.end());
  if (near.size() > MOST_TOGETHER) near.resize(MOST_TOGETHER);
  std::vector<std::size_t> members;
  for (const auto& [far, k] : near) members.push_back(k);
  std::sort(members.begin(), members.end());
  return members;
}

// The residual plus the responses of the members.
WeightedLines ModalSearch::window(const Span& span, const std::vector<std::size_t>& members) const {
  const auto cut = [&](const auto& values) {
    using Values = std::decay_t<decltype(values)>;
    return Values(values.begin() + static_cast<std::ptrdiff_t>(span.first),
                  values.begin() + static_cast<std::ptrdiff_t>(span.last));
  };
  WeightedLines part;
  part.frequency = cut(lines_.frequency);
  for (std::size_t o = 0; o < lines_.frfs(); ++o) {
    part.weight.push_back(cut(lines_.weight[o]));
    part.value.push_back(cut(residual_[o]));
    for (const std::size_t k : members) {
      for (std::size_t i = 0; i < part.size(); ++i)
        part.value[o][i] += modes_[k].response(o, part.frequency[i]);
    }
  }
  return part;
}

WeightedLines ModalSearch::cut(const std::vector<EstimatedMode>& all, const std::vector<std::size_t>& members,
                               double lines_a_half_width) const {
  double narrowest = INFINITY;
  for (const EstimatedMode& m : all) narrowest = std::min(narrowest, m.frequency * m.damping_ratio);
  const auto group =
      static_cast<std::size_t>(std::clamp(narrowest / lines_a_half_width / lines_.step(), 1.0, 1e6));
  return thinned(window(spanOf(all), members), group);
}

void ModalSearch::subtract(const EstimatedMode& mode, double sign) {
  for (std::size_t o = 0; o < lines_.frfs(); ++o) {
    for (std::size_t i = 0; i < lines_.size(); ++i)
      residual_[o][i] -= sign * mode.response(o, lines_.frequency[i]);
  }
}

// Share of the residual around a candidate that it explains alone.
double ModalSearch::score(const Pole& candidate) const {
  EstimatedMode m;
  m.frequency = candidate.frequency;
  m.damping_ratio = candidate.damping_ratio;
  const ModalWindow w(cut({m}, {}, SEARCH_LINES), options_.real_modes, lines_.size());
  return w.explained(m.frequency, m.damping_ratio);
}

void ModalSearch::replaceModes(const std::vector<std::size_t>& members, const ModalWindow& window,
                               const WindowFit& fit) {
  for (auto k = members.rbegin(); k != members.rend(); ++k) {
    subtract(modes_[*k], -1.0);
    modes_.erase(modes_.begin() + static_cast<std::ptrdiff_t>(*k));
  }
  for (Index k = 0; k < fit.poles.modes(); ++k) {
    modes_.push_back(describe(window, fit, k));
    subtract(modes_.back(), 1.0);
  }
}

// Fits the members and one more mode together; drops the weakest while it is not significant.
bool ModalSearch::refit(const std::vector<std::size_t>& members, const EstimatedMode* more, bool last) {
  std::vector<EstimatedMode> all;
  PoleList poles;
  for (const std::size_t k : members) all.push_back(modes_[k]);
  if (more) all.push_back(*more);
  for (const EstimatedMode& m : all)
    poles = poles.with(m.frequency, std::clamp(m.damping_ratio, 3e-6, WIDEST_DAMPING));
  ModalWindow w(cut(all, members, last ? FIT_LINES : SEARCH_LINES), options_.real_modes, lines_.size());
  const auto fitted = [&](const PoleList& start) {
    return w.assess(w.refined(start, last ? LAST_STEPS : STEPS, last ? CLOSELY : ROUGHLY));
  };
  WindowFit fit = fitted(poles);
  if (w.addMisfit(fit)) fit = fitted(fit.poles);
  const Index before = static_cast<Index>(members.size());
  for (Index k = worst(fit, DOUBTFUL); k >= 0; k = worst(fit, DOUBTFUL)) {
    if (more && (k == before || fit.poles.modes() <= before))
      return false;  // the number of modes did not increase
    fit = fitted(fit.poles.without(k));
  }
  replaceModes(members, w, fit);
  return true;
}

// The mode to be dropped first; -1: none.
Index ModalSearch::worst(const WindowFit& fit, double least) const {
  const auto evidence = [&](Index k) { return fit.evidence[static_cast<std::size_t>(k)]; };
  Index found = -1;
  for (Index k = 0; k < fit.poles.modes(); ++k) {
    const bool wide = fit.poles.damping(k) > WIDEST_DAMPING || !inBand(fit.poles.frequency(k), 0.0);
    if (evidence(k) >= least && !wide) continue;
    if (found < 0 || evidence(k) < evidence(found)) found = k;
  }
  return found;
}

void ModalSearch::fitCluster(const std::vector<Pole>& cluster) {
  std::vector<EstimatedMode> all;
  PoleList poles;
  for (const Pole& p : cluster) {
    EstimatedMode m;
    m.frequency = p.frequency;
    m.damping_ratio = p.damping_ratio;
    all.push_back(m);
    poles = poles.with(m.frequency, m.damping_ratio);
  }
  ModalWindow w(cut(all, {}, SEARCH_LINES), options_.real_modes, lines_.size());
  WindowFit fit = w.assess(poles);
  if (w.addMisfit(fit)) fit = w.assess(poles);
  for (Index k = worst(fit, DUPLICATE); k >= 0; k = worst(fit, DUPLICATE))
    fit = w.assess(fit.poles.without(k));
  if (fit.poles.modes() == 0) return;
  fit = w.assess(w.refined(fit.poles, STEPS, ROUGHLY));
  for (Index k = worst(fit, DOUBTFUL); k >= 0; k = worst(fit, DOUBTFUL))
    fit = w.assess(w.refined(fit.poles.without(k), STEPS, ROUGHLY));
  replaceModes({}, w, fit);
}

bool ModalSearch::startWith(std::vector<Pole> candidates) {
  std::sort(candidates.begin(), candidates.end(),
            [](const Pole& a, const Pole& b) { return a.frequency < b.frequency; });
  // Twice: modes masked by strong neighbours appear after these are subtracted.
  for (int pass = 0; pass < 2; ++pass) {
    std::vector<Pole> cluster;
    for (const Pole& p : candidates) {
      if (!inBand(p.frequency, 0.0) || p.damping_ratio > WIDEST_DAMPING || hasModeAt(p)) continue;
      // A window has a least number of lines, however narrow its modes, and includes all modes inside.
      const auto width = [&](const Pole& q) { return std::max(q.halfWidth(), 2.0 * lines_.step()); };
      const bool separate = !cluster.empty() && p.frequency - cluster.back().frequency >
                                                    TOGETHER * (width(p) + width(cluster.back()));
      if (separate || cluster.size() >= MOST_AT_START) {
        if (!reportProgress(0.1 + 0.05 * pass)) return false;
        fitCluster(cluster);
        cluster.clear();
      }
      cluster.push_back(p);
    }
    if (!cluster.empty()) fitCluster(cluster);
  }
  return true;
}

// Whether a mode exists already at this pole.
bool ModalSearch::hasModeAt(const Pole& p) const {
  return std::any_of(modes_.begin(), modes_.end(), [&](const EstimatedMode& m) {
    return std::abs(m.frequency - p.frequency) < std::max(m.frequency * m.damping_ratio, p.halfWidth());
  });
}

std::size_t ModalSearch::countUnmatched(const std::vector<Pole>& candidates) const {
  return static_cast<std::size_t>(std::count_if(candidates.begin(), candidates.end(), [&](const Pole& p) {
    return std::none_of(modes_.begin(), modes_.end(), [&](const EstimatedMode& m) {
      return m.evidence >= PROVEN && std::abs(m.frequency - p.frequency) < p.halfWidth();
    });
  }));
}

void ModalSearch::continueFrom(ModalSearch other) {
  residual_ = std::move(other.residual_);
  modes_ = std::move(other.modes_);
  tried_frequencies_ = std::move(other.tried_frequencies_);
}

bool ModalSearch::tryPole(double frequency, double damping) {
  if (modes_.size() >= static_cast<std::size_t>(options_.max_modes)) return false;
  EstimatedMode more;
  more.frequency = frequency;
  more.damping_ratio = damping;
  return refit(neighbours(frequency, damping), &more, false);
}

bool ModalSearch::addCandidates(std::vector<Pole> candidates) {
  std::vector<double> scores;
  for (const Pole& c : candidates) scores.push_back(score(c));
  const std::size_t all = candidates.size();
  // Limits the number of tries, whatever the number of candidates.
  for (std::size_t tries = 2 * modes_.size() + MOST_TRIES; tries > 0 && !candidates.empty(); --tries) {
    if (!reportProgress(0.25 +
                        0.45 * (1.0 - static_cast<double>(candidates.size()) / static_cast<double>(all))))
      return false;
    const auto best = std::max_element(scores.begin(), scores.end()) - scores.begin();
    if (!(scores[static_cast<std::size_t>(best)] > DOUBTFUL)) break;
    const Pole c = candidates[static_cast<std::size_t>(best)];
    candidates.erase(candidates.begin() + best);
    scores.erase(scores.begin() + best);
    if (!tryPole(c.frequency, c.damping_ratio)) continue;
    for (std::size_t k = 0; k < candidates.size(); ++k) {
      const Pole& other = candidates[k];
      const double far = reach(c.frequency, c.damping_ratio) + reach(other.frequency, other.damping_ratio);
      if (std::abs(other.frequency - c.frequency) < far) scores[k] = score(other);
    }
  }
  return true;
}

// Frequency of the largest residual relative to the noise; 0: not larger than by chance.
double ModalSearch::frequencyOfLargestResidual() const {
  const std::size_t n = lines_.size();
  std::vector<double> power(n, 0.0);
  for (std::size_t o = 0; o < lines_.frfs(); ++o) {
    for (std::size_t i = 1; i + 1 < n; ++i) {
      // Smooth residuals belong to the background parabola.
      const Complex bend = 2.0 * residual_[o][i] - residual_[o][i - 1] - residual_[o][i + 1];
      power[i] += std::norm(lines_.weight[o][i] * bend);
    }
  }
  const double usual = median(power) / std::log(2.0);
  double most = usual * (std::log(static_cast<double>(n)) + 7.0), where = 0.0;
  for (std::size_t i = 3; i + 3 < n; ++i) {
    const double f = lines_.frequency[i];
    if (!(power[i] > most)) continue;
    const double margin = std::max(3.0 * lines_.step(), 0.002 * f);
    if (std::any_of(tried_frequencies_.begin(), tried_frequencies_.end(),
                    [&](double t) { return std::abs(t - f) < margin; }))
      continue;
    most = power[i];
    where = f;
  }
  return where;
}

bool ModalSearch::addAtLargestResidual(int rounds) {
  for (int round = 0; round < rounds; ++round) {
    if (!reportProgress(0.7 + 0.15 * round / rounds)) return false;
    const double f = frequencyOfLargestResidual();
    if (!(f > 0.0)) break;
    tried_frequencies_.push_back(f);
    for (const double damping : {3.0 * lines_.step() / f, 0.3 * lines_.step() / f}) {
      if (tryPole(f, std::min(damping, 0.1))) break;
    }
  }
  return true;
}

bool ModalSearch::refitAll(int sweeps, bool last) {
  for (int sweep = 0; sweep < sweeps; ++sweep) {
    std::vector<double> frequencies;
    for (const EstimatedMode& m : modes_) frequencies.push_back(m.frequency);
    std::sort(frequencies.begin(), frequencies.end());
    for (const double f : frequencies) {
      if (!reportProgress(last ? 0.85 + 0.07 * sweep : 0.2)) return false;
      for (std::size_t k = 0; k < modes_.size(); ++k) {
        if (std::abs(modes_[k].frequency - f) > 0.1 * modes_[k].damping_ratio * f) continue;
        refit(neighbours(modes_[k].frequency, modes_[k].damping_ratio), nullptr, last && sweep + 1 == sweeps);
        break;
      }
    }
  }
  return true;
}

void ModalSearch::addByMagnitude() {
  const std::size_t n = lines_.size();
  std::vector<double> magnitude(n, 0.0);
  for (std::size_t o = 0; o < lines_.frfs(); ++o) {
    for (std::size_t i = 0; i < n; ++i) magnitude[i] += std::norm(lines_.value[o][i]);
  }
  for (double& m : magnitude) m = std::sqrt(m);
  for (std::size_t i = 4; i + 4 < n; ++i) {
    const auto begin = magnitude.begin() + static_cast<std::ptrdiff_t>(i > ABOUT ? i - ABOUT : 0);
    const auto end = magnitude.begin() + static_cast<std::ptrdiff_t>(std::min(n, i + ABOUT + 1));
    if (magnitude[i] < *std::max_element(begin, end) || magnitude[i] < CLEAR_PEAK * median({begin, end}))
      continue;
    const double f = lines_.frequency[i], margin = 4.0 * lines_.step();
    // Where the force has no power, noise looks like a peak.
    double noise = 0.0;
    for (std::size_t o = 0; o < lines_.frfs(); ++o)
      noise += 2.0 / (lines_.weight[o][i] * lines_.weight[o][i]);
    if (magnitude[i] < CLEAR_PEAK * std::sqrt(noise)) continue;
    const auto here = [&](const EstimatedMode& m) {
      return std::abs(m.frequency - f) < margin + m.frequency * m.damping_ratio;
    };
    if (std::any_of(modes_.begin(), modes_.end(),
                    [&](const EstimatedMode& m) { return here(m) && m.evidence >= PROVEN; }))
      continue;
    if (!fitMagnitude(magnitude, i)) continue;
    const EstimatedMode fitted_mode = modes_.back();
    modes_.pop_back();
    modes_.erase(std::remove_if(modes_.begin(), modes_.end(), here), modes_.end());
    modes_.push_back(fitted_mode);
  }
}

bool ModalSearch::fitMagnitude(const std::vector<double>& magnitude, std::size_t peak) {
  EstimatedMode m;
  m.frequency = lines_.frequency[peak];
  const ModalWindow w(window(spanOf({m}), {}), options_.real_modes, lines_.size());
  const std::vector<double>& f = w.lines().frequency;
  const auto first =
      static_cast<std::size_t>(std::lower_bound(lines_.frequency.begin(), lines_.frequency.end(), f.front()) -
                               lines_.frequency.begin());
  const auto count = static_cast<Index>(f.size());
  // log |H| = log a + log |unitMode|, with the best a
  const fit::FunctionResiduals residuals(count, [&](const Eigen::VectorXd& at, Eigen::VectorXd& difference) {
    for (Index i = 0; i < count; ++i) {
      const auto k = static_cast<std::size_t>(i);
      difference[i] =
          std::log(magnitude[first + k] / std::abs(unitMode(f[k], std::exp(at[0]), std::exp(at[1]))));
    }
    difference.array() -= difference.mean();
  });
  const double line = lines_.step() / m.frequency, at = std::log(m.frequency);
  const double narrowest = std::log(0.02 * line), widest = std::log(0.1);
  fit::Options options;
  options.name = "mode by magnitude";
  const fit::Parameter frequency_parameter{at, at - 2.0 * line, at + 2.0 * line, line};
  fit::Result found = fit::minimise(
      residuals, {frequency_parameter, {std::log(0.5 * line), narrowest, widest, 0.3}}, options);
  if (!found.usable()) return false;
  Eigen::VectorXd plain(count);
  for (Index i = 0; i < count; ++i) plain[i] = std::log(magnitude[first + static_cast<std::size_t>(i)]);
  plain.array() -= plain.mean();
  const double variance = found.squares / static_cast<double>(count - 3);
  const double height = plain[static_cast<Index>(peak - first)];
  const double evidence = (plain.squaredNorm() - height * height - found.squares) / variance / w.limit(2);
  if (!(evidence >= PROVEN)) return false;
  // A peak narrower than the line spacing only gives an upper bound of the damping: the mean over all values
  // weighted by the misfit.
  double weights = 0.0, mean = 0.0, square = 0.0;
  for (int i = 0; i <= DAMPINGS; ++i) {
    const double damping = narrowest + (widest - narrowest) * i / DAMPINGS;
    const double squares =
        fit::minimise(residuals, {frequency_parameter, {damping, damping, damping, 1.0}}, options).squares -
        found.squares;
    const double zeta = std::exp(damping), weight = zeta * std::exp(-0.5 * std::max(squares, 0.0) / variance);
    weights += weight;
    mean += weight * zeta;
    square += weight * zeta * zeta;
  }
  mean /= weights;
  const fit::Covariance covariance = fit::covarianceOf(found.jacobian);
  found.value[1] = std::log(mean);
  m = describe(w, w.assess(PoleList{found.value}), 0);
  const double log_frequency_std = std::sqrt(variance) * covariance.deviation(0);
  m.frequency_std = m.frequency * (log_frequency_std > 0.0 ? std::min(log_frequency_std, line) : line);
  m.damping_ratio_std = std::sqrt(std::max(square / weights - mean * mean, std::pow(0.01 * mean, 2)));
  m.evidence = evidence;
  modes_.push_back(m);
  return true;
}

std::vector<EstimatedMode> ModalSearch::results(bool proven) const {
  std::vector<EstimatedMode> sorted;
  for (const EstimatedMode& m : modes_) {
    if ((m.evidence >= PROVEN && inBand(m.frequency, m.damping_ratio)) == proven) sorted.push_back(m);
  }
  std::sort(sorted.begin(), sorted.end(),
            [](const EstimatedMode& a, const EstimatedMode& b) { return a.frequency < b.frequency; });
  return sorted;
}

}  // namespace smartmill
