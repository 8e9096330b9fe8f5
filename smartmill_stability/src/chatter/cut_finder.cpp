#include "chatter/cut_finder.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <utility>

#include "smartmill_core/error.h"
#include "smartmill_core/formatted.h"
#include "smartmill_core/signal/fourier.h"
#include "smartmill_core/signal/spectral_lines.h"
#include "smartmill_core/signal/window.h"
#include "smartmill_core/units.h"

namespace smartmill::stability {
namespace {

/// Blackman-Harris window: the side lobes of strong harmonics stay below chatter lines.
std::vector<double> taper(std::size_t n) {
  std::vector<double> window(n);
  for (std::size_t i = 0; i < n; ++i)
    window[i] = blackmanHarris(units::TWO_PI * static_cast<double>(i) / static_cast<double>(n));
  return window;
}

Spectrogram spectrogramOf(const Recording& recording, double window_seconds, double highest) {
  const auto length = static_cast<std::size_t>(window_seconds * recording.sample_rate);
  const std::size_t hop = length / 2, samples = recording.channels[0].size();
  const std::vector<double> window = taper(length);
  Spectrogram result;
  const double step = recording.sample_rate / static_cast<double>(length);
  const auto lines = static_cast<std::size_t>(std::min(highest, 0.45 * recording.sample_rate) / step);
  for (std::size_t k = 0; k < lines; ++k) result.frequency.push_back(step * static_cast<double>(k));
  std::vector<double> size;  // mean square of each channel
  for (const std::vector<double>& channel : recording.channels) {
    const double n = static_cast<double>(samples);
    const double mean = std::accumulate(channel.begin(), channel.end(), 0.0) / n;
    double square = 0.0;
    for (const double v : channel) square += (v - mean) * (v - mean) / n;
    size.push_back(square);
  }
  std::vector<double> piece(length);
  for (std::size_t at = 0; at + length <= samples; at += hop) {
    std::vector<double> power(lines, 0.0);
    for (std::size_t c = 0; c < recording.channels.size(); ++c) {
      if (!(size[c] > 0.0)) continue;
      const double* values = recording.channels[c].data() + at;
      const double mean = std::accumulate(values, values + length, 0.0) / static_cast<double>(length);
      for (std::size_t i = 0; i < length; ++i) piece[i] = (values[i] - mean) * window[i];
      const auto spectrum = fourier(piece);
      const double scale = 1.0 / (size[c] * static_cast<double>(length * length));
      for (std::size_t k = 0; k < lines; ++k) power[k] += scale * std::norm(spectrum[k]);
    }
    result.time.push_back((static_cast<double>(at) + 0.5 * static_cast<double>(length)) /
                          recording.sample_rate);
    result.power.push_back(std::move(power));
  }
  return result;
}

}  // namespace

CutFinder::CutFinder(const Recording& recording, const RecordingRequest& request) : request_(request) {
  const double seconds = static_cast<double>(recording.channels[0].size()) / recording.sample_rate;
  const double turn = units::TWO_PI / request.speed;
  window_ = std::min(std::clamp(options_.turns * turn, options_.least_window, options_.longest_window),
                     2.0 * seconds / (options_.least_windows + 1));
  if (window_ < 8.0 * turn)
    throw Error(formatted("recording: %.2f s with %.0f revolutions: expected at least %d revolutions",
                          seconds, seconds / turn, 8 * (options_.least_windows + 1) / 2));
  spectrogram_ = spectrogramOf(recording, window_, options_.highest);
  step_ = spectrogram_.frequency[1];
  findCut();
  in_cut_ = mean(true);
  floor_ = noiseFloor(in_cut_);
  findSpeed();
  refineSpeed();
}

double CutFinder::from() const {
  return spectrogram_
      .time[static_cast<std::size_t>(std::find(cut_.begin(), cut_.end(), true) - cut_.begin())];
}

double CutFinder::to() const {
  const auto last = cut_.rend() - std::find(cut_.rbegin(), cut_.rend(), true) - 1;
  return spectrogram_.time[static_cast<std::size_t>(last)];
}

bool CutFinder::within(bool cut, double from, double to) const {
  for (std::size_t w = 0; w < cut_.size(); ++w)
    if (spectrogram_.time[w] + 0.5 * window_ > from && spectrogram_.time[w] - 0.5 * window_ < to &&
        cut_[w] != cut)
      return false;
  return true;
}

std::size_t CutFinder::lineAt(double frequency) const {
  return std::min(in_cut_.size() - 1, static_cast<std::size_t>(std::lround(frequency / step_)));
}

/// Separates loud from quiet windows, by Otsu's threshold on the logarithm of their power.
void CutFinder::findCut() {
  std::vector<double> level;
  for (const std::vector<double>& power : spectrogram_.power) {
    double sum = 0.0;
    for (auto k = static_cast<std::size_t>(options_.lowest / step_); k < power.size(); ++k) sum += power[k];
    level.push_back(std::log(std::max(1e-30, sum)));
  }
  std::vector<double> sorted = level;
  std::sort(sorted.begin(), sorted.end());
  const auto n = static_cast<double>(sorted.size());
  const double all = std::accumulate(sorted.begin(), sorted.end(), 0.0);
  double best = -1.0, below = 0.0, threshold = 0.0, contrast = 0.0;
  for (std::size_t i = 0; i + 1 < sorted.size(); ++i) {
    below += sorted[i];
    const double low = below / (static_cast<double>(i) + 1.0),
                 high = (all - below) / (n - static_cast<double>(i) - 1.0);
    const double between =
        (static_cast<double>(i) + 1.0) * (n - static_cast<double>(i) - 1.0) * (high - low) * (high - low);
    if (!(between > best)) continue;
    best = between;
    threshold = 0.5 * (sorted[i] + sorted[i + 1]);
    contrast = high - low;
  }
  has_air_ = contrast > std::log(options_.contrast);
  for (std::size_t w = 0; w < level.size(); ++w) cut_.push_back(!has_air_ || level[w] > threshold);
  if (has_air_ && !loudFromTeeth()) {
    has_air_ = false;
    cut_.assign(level.size(), true);
  }
}

/// Whether the loud windows are louder at the tooth passing frequency: a cut, not a vibration that grows
/// within a cut.
bool CutFinder::loudFromTeeth() const {
  const auto loud = static_cast<double>(std::count(cut_.begin(), cut_.end(), true));
  const double all = static_cast<double>(cut_.size());
  if (std::min(loud, all - loud) < std::max(2.0, options_.least_part * all)) return false;
  const std::vector<double> cut = mean(true), air = mean(false);
  double in = 0.0, out = 0.0;
  const double tooth = request_.teeth * request_.speed / units::TWO_PI;
  for (double f = tooth; f < spectrogram_.frequency.back(); f += tooth) {
    const double reach = request_.speed_error * f + options_.main_lobe * step_;
    if (f < options_.lowest) continue;
    if (reach > 0.25 * tooth) break;  // higher harmonics are not resolved
    const auto from = static_cast<std::size_t>((f - reach) / step_);
    const auto to = std::min(cut.size() - 1, static_cast<std::size_t>((f + reach) / step_));
    for (std::size_t k = from; k <= to; ++k) {
      in += cut[k];
      out += air[k];
    }
  }
  return in > options_.tooth_contrast * out;
}

/// Mean spectrum of the windows in the cut or outside, without those at a transition unless there are no
/// others. Empty without such windows.
std::vector<double> CutFinder::mean(bool cut) const {
  std::vector<double> sum(spectrogram_.frequency.size(), 0.0);
  for (const bool inner : {true, false}) {
    int count = 0;
    for (std::size_t w = 0; w < cut_.size(); ++w) {
      const bool same =
          cut_[w] == cut &&
          (!inner || ((w == 0 || cut_[w - 1] == cut) && (w + 1 == cut_.size() || cut_[w + 1] == cut)));
      if (!same) continue;
      ++count;
      for (std::size_t k = 0; k < sum.size(); ++k) sum[k] += spectrogram_.power[w][k];
    }
    if (count == 0) continue;
    for (double& v : sum) v /= count;
    return sum;
  }
  return {};
}

/// Agreement of the lines with the tooth passing harmonics at a speed.
double CutFinder::combScore(double speed) const {
  const double tooth = request_.teeth * speed / units::TWO_PI;
  double score = 0.0;
  for (double f = tooth; f < spectrogram_.frequency.back(); f += tooth) {
    const std::size_t k = lineAt(f);
    if (f > options_.lowest) score += std::log1p(in_cut_[k] / floor_[k]);
  }
  return score;
}

void CutFinder::findSpeed() {
  speed_ = request_.speed;
  // A correction larger than the effect of load must improve the score.
  double best = combScore(request_.speed);
  const double step = 0.3 * step_ / spectrogram_.frequency.back();
  for (double off = -request_.speed_error; off <= request_.speed_error; off += step) {
    const double speed = request_.speed * (1.0 + off);
    const double score = combScore(speed) / (std::abs(off) > options_.loaded ? options_.beyond : 1.0);
    if (!(score > best)) continue;
    best = score;
    speed_ = speed;
  }
}

/// Replaces the speed by the weighted median of the frequencies of the harmonics over their orders, unless
/// they agree worse then: a strong line near a harmonic may draw it away.
void CutFinder::refineSpeed() {
  std::vector<std::pair<double, double>> speeds;  // and weight
  const double spindle = speed_ / units::TWO_PI;
  const auto reach = static_cast<std::size_t>(options_.main_lobe);
  double weights = 0.0;
  for (int order = 1;; ++order) {
    const auto center = static_cast<std::size_t>(std::lround(order * spindle / step_));
    if (center + reach + 1 >= in_cut_.size()) break;
    if (order * spindle < options_.lowest || center < reach + 1) continue;
    const auto from = in_cut_.begin() + static_cast<std::ptrdiff_t>(center - reach);
    const auto to = in_cut_.begin() + static_cast<std::ptrdiff_t>(center + reach);
    const auto peak = std::max_element(from, to + 1);
    const auto at = static_cast<std::size_t>(peak - in_cut_.begin());
    if (peak == from || peak == to || *peak < options_.present * floor_[at]) continue;
    speeds.emplace_back(peakPosition(in_cut_, at) * step_ / order * units::TWO_PI, order);
    weights += order;
  }
  constexpr std::size_t FEWEST = 3;
  if (speeds.size() < FEWEST) return;
  std::sort(speeds.begin(), speeds.end());
  auto middle = speeds.begin();
  for (double sum = middle->second; sum < 0.5 * weights; sum += middle->second) ++middle;
  if (combScore(middle->first) >= options_.retained * combScore(speed_)) speed_ = middle->first;
}

/// Whether tooth passing harmonics are present.
bool CutFinder::hasToothPassing() const {
  int found = 0;
  for (int k = 1; k <= 3; ++k) {
    const std::size_t at = lineAt(k * request_.teeth * speed_ / units::TWO_PI);
    found += in_cut_[at] > options_.present * floor_[at];
  }
  return found >= 2;
}

}  // namespace smartmill::stability
