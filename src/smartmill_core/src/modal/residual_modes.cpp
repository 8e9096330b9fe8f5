#include "residual_modes.h"

#include <algorithm>
#include <cmath>

namespace smartmill {
namespace {

using Complex = std::complex<double>;
using Eigen::Index;

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

}  // namespace

EstimatedMode describeMode(const ModalWindow& window, const WindowFit& f, Index k) {
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

void ResidualModes::continueFrom(ResidualModes other) {
  residual_ = std::move(other.residual_);
  modes_ = std::move(other.modes_);
}

double ResidualModes::reach(double frequency, double damping) const {
  return std::max(options_.reach * damping * frequency, options_.least_lines * lines_.step());
}

bool ResidualModes::inBand(double frequency, double damping) const {
  const double margin =
      std::max(options_.from_end * lines_.step(), options_.half_widths_from_end * damping * frequency);
  return frequency > lines_.frequency.front() + margin && frequency < lines_.frequency.back() - margin;
}

LineSpan ResidualModes::spanOf(const std::vector<EstimatedMode>& members) const {
  double low = lines_.frequency.back(), high = lines_.frequency.front();
  for (const EstimatedMode& m : members) {
    low = std::min(low, m.frequency - reach(m.frequency, m.damping_ratio));
    high = std::max(high, m.frequency + reach(m.frequency, m.damping_ratio));
  }
  const auto begin = lines_.frequency.begin(), end = lines_.frequency.end();
  LineSpan span{static_cast<std::size_t>(std::lower_bound(begin, end, low) - begin),
                static_cast<std::size_t>(std::upper_bound(begin, end, high) - begin)};
  // At the ends of the band the window keeps its number of lines.
  const auto least = static_cast<std::size_t>(2.0 * options_.least_lines);
  if (span.last - span.first < least) {
    span.last = std::min(lines_.size(), span.first + least);
    span.first = span.last > least ? std::min(span.first, span.last - least) : 0;
  }
  return span;
}

std::vector<std::size_t> ResidualModes::neighbours(double frequency, double damping) const {
  const double width = std::max(damping * frequency, 2.0 * lines_.step());
  std::vector<std::pair<double, std::size_t>> near;
  for (std::size_t k = 0; k < modes_.size(); ++k) {
    const EstimatedMode& m = modes_[k];
    const double far = std::abs(m.frequency - frequency) /
                       (width + std::max(m.damping_ratio * m.frequency, 2.0 * lines_.step()));
    if (far < options_.together) near.emplace_back(far, k);
  }
  std::sort(near.begin(), near.end());
  if (near.size() > options_.most_together) near.resize(options_.most_together);
  std::vector<std::size_t> members;
  for (const auto& [far, k] : near) members.push_back(k);
  std::sort(members.begin(), members.end());
  return members;
}

WeightedLines ResidualModes::window(const LineSpan& span, const std::vector<std::size_t>& members) const {
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

WeightedLines ResidualModes::cut(const std::vector<EstimatedMode>& all,
                                 const std::vector<std::size_t>& members, double lines_a_half_width) const {
  double narrowest = INFINITY;
  for (const EstimatedMode& m : all) narrowest = std::min(narrowest, m.frequency * m.damping_ratio);
  const auto group =
      static_cast<std::size_t>(std::clamp(narrowest / lines_a_half_width / lines_.step(), 1.0, 1e6));
  return thinned(window(spanOf(all), members), group);
}

void ResidualModes::subtract(const EstimatedMode& mode, double sign) {
  for (std::size_t o = 0; o < lines_.frfs(); ++o) {
    for (std::size_t i = 0; i < lines_.size(); ++i)
      residual_[o][i] -= sign * mode.response(o, lines_.frequency[i]);
  }
}

void ResidualModes::replace(const std::vector<std::size_t>& members, const ModalWindow& window,
                            const WindowFit& fit) {
  for (auto k = members.rbegin(); k != members.rend(); ++k) {
    subtract(modes_[*k], -1.0);
    modes_.erase(modes_.begin() + static_cast<std::ptrdiff_t>(*k));
  }
  for (Index k = 0; k < fit.poles.modes(); ++k) {
    modes_.push_back(describeMode(window, fit, k));
    subtract(modes_.back(), 1.0);
  }
}

}  // namespace smartmill
