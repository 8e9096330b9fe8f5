#include "modal_search.h"

#include <algorithm>
#include <cmath>

#include "smartmill_core/signal/statistics.h"

namespace smartmill {
namespace {

using Complex = std::complex<double>;
using Eigen::Index;

}  // namespace

ModalSearch::ModalSearch(const WeightedLines& lines, const ModalEstimateOptions& options)
    : options_(options), search_(options.search), found_(lines, search_) {
}

bool ModalSearch::reportProgress(double share) const {
  return !options_.progress || options_.progress(share);
}

// Share of the residual around a candidate that it explains alone.
double ModalSearch::score(const Pole& candidate) const {
  EstimatedMode m;
  m.frequency = candidate.frequency;
  m.damping_ratio = candidate.damping_ratio;
  const ModalWindow w(found_.cut({m}, {}, search_.search_lines), options_, found_.lines().size());
  return w.explained(m.frequency, m.damping_ratio);
}

// Fits the members and one more mode together; drops the weakest while it is not significant.
bool ModalSearch::refit(const std::vector<std::size_t>& members, const EstimatedMode* more, bool last) {
  std::vector<EstimatedMode> all;
  PoleList poles;
  for (const std::size_t k : members) all.push_back(found_.modes()[k]);
  if (more) all.push_back(*more);
  for (const EstimatedMode& m : all)
    poles = poles.with(m.frequency, std::clamp(m.damping_ratio, 3e-6, search_.widest_damping));
  ModalWindow w(found_.cut(all, members, last ? search_.fit_lines : search_.search_lines), options_,
                found_.lines().size());
  const auto fitted = [&](const PoleList& start) {
    return w.assess(w.refined(start, last ? search_.last_steps : search_.steps,
                              last ? search_.closely : search_.roughly));
  };
  WindowFit fit = fitted(poles);
  if (w.addMisfit(fit)) fit = fitted(fit.poles);
  const Index before = static_cast<Index>(members.size());
  for (Index k = worst(fit, search_.doubtful); k >= 0; k = worst(fit, search_.doubtful)) {
    if (more && (k == before || fit.poles.modes() <= before))
      return false;  // the number of modes did not increase
    fit = fitted(fit.poles.without(k));
  }
  found_.replace(members, w, fit);
  return true;
}

// The mode to be dropped first; -1: none.
Index ModalSearch::worst(const WindowFit& fit, double least) const {
  const auto evidence = [&](Index k) { return fit.evidence[static_cast<std::size_t>(k)]; };
  Index found = -1;
  for (Index k = 0; k < fit.poles.modes(); ++k) {
    const bool wide =
        fit.poles.damping(k) > search_.widest_damping || !found_.inBand(fit.poles.frequency(k), 0.0);
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
  ModalWindow w(found_.cut(all, {}, search_.search_lines), options_, found_.lines().size());
  WindowFit fit = w.assess(poles);
  if (w.addMisfit(fit)) fit = w.assess(poles);
  for (Index k = worst(fit, search_.duplicate); k >= 0; k = worst(fit, search_.duplicate))
    fit = w.assess(fit.poles.without(k));
  if (fit.poles.modes() == 0) return;
  fit = w.assess(w.refined(fit.poles, search_.steps, search_.roughly));
  for (Index k = worst(fit, search_.doubtful); k >= 0; k = worst(fit, search_.doubtful))
    fit = w.assess(w.refined(fit.poles.without(k), search_.steps, search_.roughly));
  found_.replace({}, w, fit);
}

bool ModalSearch::startWith(std::vector<Pole> candidates) {
  std::sort(candidates.begin(), candidates.end(),
            [](const Pole& a, const Pole& b) { return a.frequency < b.frequency; });
  // Twice: modes masked by strong neighbours appear after these are subtracted.
  for (int pass = 0; pass < 2; ++pass) {
    std::vector<Pole> cluster;
    for (const Pole& p : candidates) {
      if (!found_.inBand(p.frequency, 0.0) || p.damping_ratio > search_.widest_damping || hasModeAt(p))
        continue;
      // A window has a least number of lines, however narrow its modes, and includes all modes inside.
      const auto width = [&](const Pole& q) { return std::max(q.halfWidth(), 2.0 * found_.lines().step()); };
      const bool separate = !cluster.empty() && p.frequency - cluster.back().frequency >
                                                    search_.together * (width(p) + width(cluster.back()));
      if (separate || cluster.size() >= search_.most_at_start) {
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
  return std::any_of(found_.modes().begin(), found_.modes().end(), [&](const EstimatedMode& m) {
    return std::abs(m.frequency - p.frequency) < std::max(m.frequency * m.damping_ratio, p.halfWidth());
  });
}

std::size_t ModalSearch::countUnmatched(const std::vector<Pole>& candidates) const {
  return static_cast<std::size_t>(std::count_if(candidates.begin(), candidates.end(), [&](const Pole& p) {
    return std::none_of(found_.modes().begin(), found_.modes().end(), [&](const EstimatedMode& m) {
      return m.evidence >= search_.proven && std::abs(m.frequency - p.frequency) < p.halfWidth();
    });
  }));
}

void ModalSearch::continueFrom(ModalSearch other) {
  found_.continueFrom(std::move(other.found_));
  tried_frequencies_ = std::move(other.tried_frequencies_);
}

bool ModalSearch::tryPole(double frequency, double damping) {
  if (found_.modes().size() >= static_cast<std::size_t>(options_.max_modes)) return false;
  EstimatedMode more;
  more.frequency = frequency;
  more.damping_ratio = damping;
  return refit(found_.neighbours(frequency, damping), &more, false);
}

bool ModalSearch::addCandidates(std::vector<Pole> candidates) {
  std::vector<double> scores;
  for (const Pole& c : candidates) scores.push_back(score(c));
  const std::size_t all = candidates.size();
  // Limits the number of tries, whatever the number of candidates.
  for (std::size_t tries = 2 * found_.modes().size() + search_.most_tries; tries > 0 && !candidates.empty();
       --tries) {
    if (!reportProgress(0.25 +
                        0.45 * (1.0 - static_cast<double>(candidates.size()) / static_cast<double>(all))))
      return false;
    const auto best = std::max_element(scores.begin(), scores.end()) - scores.begin();
    if (!(scores[static_cast<std::size_t>(best)] > search_.doubtful)) break;
    const Pole c = candidates[static_cast<std::size_t>(best)];
    candidates.erase(candidates.begin() + best);
    scores.erase(scores.begin() + best);
    if (!tryPole(c.frequency, c.damping_ratio)) continue;
    for (std::size_t k = 0; k < candidates.size(); ++k) {
      const Pole& other = candidates[k];
      const double far =
          found_.reach(c.frequency, c.damping_ratio) + found_.reach(other.frequency, other.damping_ratio);
      if (std::abs(other.frequency - c.frequency) < far) scores[k] = score(other);
    }
  }
  return true;
}

// Frequency of the largest residual relative to the noise; 0: not larger than by chance.
double ModalSearch::frequencyOfLargestResidual() const {
  const std::size_t n = found_.lines().size();
  std::vector<double> power(n, 0.0);
  for (std::size_t o = 0; o < found_.lines().frfs(); ++o) {
    for (std::size_t i = 1; i + 1 < n; ++i) {
      // Smooth residuals belong to the background parabola.
      const Complex bend =
          2.0 * found_.residual()[o][i] - found_.residual()[o][i - 1] - found_.residual()[o][i + 1];
      power[i] += std::norm(found_.lines().weight[o][i] * bend);
    }
  }
  const double usual = median(power) / std::log(2.0);
  double most = usual * (std::log(static_cast<double>(n)) + 7.0), where = 0.0;
  for (std::size_t i = 3; i + 3 < n; ++i) {
    const double f = found_.lines().frequency[i];
    if (!(power[i] > most)) continue;
    const double margin = std::max(3.0 * found_.lines().step(), 0.002 * f);
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
    for (const double damping : {3.0 * found_.lines().step() / f, 0.3 * found_.lines().step() / f}) {
      if (tryPole(f, std::min(damping, 0.1))) break;
    }
  }
  return true;
}

bool ModalSearch::refitAll(int sweeps, bool last) {
  for (int sweep = 0; sweep < sweeps; ++sweep) {
    std::vector<double> frequencies;
    for (const EstimatedMode& m : found_.modes()) frequencies.push_back(m.frequency);
    std::sort(frequencies.begin(), frequencies.end());
    for (const double f : frequencies) {
      if (!reportProgress(last ? 0.85 + 0.07 * sweep : 0.2)) return false;
      for (std::size_t k = 0; k < found_.modes().size(); ++k) {
        if (std::abs(found_.modes()[k].frequency - f) > 0.1 * found_.modes()[k].damping_ratio * f) continue;
        refit(found_.neighbours(found_.modes()[k].frequency, found_.modes()[k].damping_ratio), nullptr,
              last && sweep + 1 == sweeps);
        break;
      }
    }
  }
  return true;
}

std::vector<EstimatedMode> ModalSearch::results(bool proven) const {
  std::vector<EstimatedMode> sorted;
  for (const EstimatedMode& m : found_.modes()) {
    if ((m.evidence >= search_.proven && found_.inBand(m.frequency, m.damping_ratio)) == proven)
      sorted.push_back(m);
  }
  std::sort(sorted.begin(), sorted.end(),
            [](const EstimatedMode& a, const EstimatedMode& b) { return a.frequency < b.frequency; });
  return sorted;
}

}  // namespace smartmill
