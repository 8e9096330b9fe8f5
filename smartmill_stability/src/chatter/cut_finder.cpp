#include "chatter/cut_finder.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <utility>

#include "chatter/order_powers.h"
#include "chatter/spectrogram.h"
#include "smartmill_core/signal/spectral_lines.h"
#include "smartmill_core/units.h"

namespace smartmill::stability {

double CutFinder::windowOf(const Recording& recording, double speed) {
  constexpr double MARGIN = 6.0;  // [samples] of the interpolation
  const CutFinderOptions options;
  const double seconds = (static_cast<double>(recording.channels[0].size()) - MARGIN) / recording.sample_rate;
  const double turn = units::TWO_PI / speed;
  const double window = std::min(std::clamp(options.turns * turn, options.least_window,
                                            std::max(options.longest_window, options.least_turns * turn)),
                                 2.0 * seconds / (options.least_windows + 1));
  return window < options.least_turns * turn ? seconds : window;  // no level of cut and air
}

CutFinder::CutFinder(const Recording& recording, const RecordingRequest& request)
    : request_(request), window_(windowOf(recording, request.speed)) {
  spectrogram_ = spectrogramOf(recording, window_, options_.highest);
  step_ = spectrogram_.frequency.size() > 1 ? spectrogram_.frequency[1] : 1.0 / window_;
  findCut();
  in_cut_ = mean(true);
  floor_ = noiseFloor(in_cut_);
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
  return std::min(spectrogram_.frequency.size() - 1,
                  static_cast<std::size_t>(std::lround(frequency / step_)));
}

/// Separates loud from quiet windows, by Otsu's threshold on the logarithm of their power.
void CutFinder::findCut() {
  if (static_cast<int>(spectrogram_.power.size()) < options_.least_windows) {
    cut_.assign(spectrogram_.power.size(), true);
    return;
  }
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

/// Whether the loud windows are louder at the tooth passing frequency, or the quiet ones those of an idle
/// spindle: a cut, not a vibration that grows within a cut.
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
  return in > options_.tooth_contrast * out || (isIdle(air) && longestLoud() > options_.least_cut);
}

/// [s] Longest part without a quiet window.
double CutFinder::longestLoud() const {
  std::size_t longest = 0, run = 0;
  for (const bool loud : cut_) {
    run = loud ? run + 1 : 0;
    longest = std::max(longest, run);
  }
  return 0.5 * window_ * static_cast<double>(longest);
}

/// Whether the other spindle harmonics of a spectrum are stronger than those of the teeth.
bool CutFinder::isIdle(const std::vector<double>& power) const {
  const OrderPowers powers = orderPowers(request_.teeth, [&](int order) {
    const double frequency = order * request_.speed / units::TWO_PI;
    return frequency > options_.lowest ? power[lineAt(frequency)] : 0.0;
  });
  return powers.others > powers.teeth;
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

/// Whether tooth passing harmonics are present.
bool CutFinder::hasToothPassing() const {
  int found = 0;
  for (int k = 1; k <= 3; ++k) {
    const std::size_t at = lineAt(k * request_.teeth * request_.speed / units::TWO_PI);
    found += in_cut_[at] > options_.present * floor_[at];
  }
  return found >= 2;
}

}  // namespace smartmill::stability
