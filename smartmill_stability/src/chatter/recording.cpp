#include "smartmill_stability/chatter/recording.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <numeric>

#include "smartmill_core/error.h"
#include "smartmill_core/formatted.h"
#include "smartmill_core/signal/fourier.h"
#include "smartmill_core/signal/window.h"
#include "smartmill_core/units.h"

namespace smartmill::stability {
namespace {

constexpr double LOWEST = 80.0, HIGHEST = 6000.0;            // [Hz] looked at
constexpr double TURNS = 32.0;                               // revolutions of a window
constexpr double LEAST_WINDOW = 0.08, LONGEST_WINDOW = 0.8;  // [s]
constexpr int LEAST_WINDOWS = 5;
constexpr double MAIN_LOBE = 3.5;  // [lines] half width of a sine under the window
constexpr double SPREAD = 0.0015;  // [1] of the frequency: the spindle's speed varies
constexpr double LINE = 14.0;      // [x] of what is beside it, power
constexpr double NARROW = 0.06;    // [1] of a line's power, this far beside it at most
constexpr double AIR = 6.0;        // [x] over the same line out of the cut, power
constexpr double PRESENT = 5.0;    // [x] of what is beside it, in one window
constexpr double STANDS = 0.6;     // [1] of the cut's windows
constexpr double CONTRAST = 1.8;   // [x] power of cutting over not cutting
constexpr double STRONG = 0.3;     // [1] of the harmonics' power: needs no companion where the air is silent
constexpr double LEAST_SHARE = 0.02;                    // [1] of the harmonics' power
constexpr double BELOW_MODE = 0.06, ABOVE_MODE = 0.15;  // [1] chatter lies above its mode, mostly
constexpr double APART = 0.5, DRIFT = 0.0006;           // [lines], [1] of the frequency: between companions
constexpr int COMPANIONS = 4;                           // tooth passings to each side

double decibel(double ratio) {
  return 10.0 * std::log10(std::max(1e-30, ratio));
}

/// So that no strong harmonic makes lines beside itself.
std::vector<double> taper(std::size_t n) {
  std::vector<double> window(n);
  for (std::size_t i = 0; i < n; ++i)
    window[i] = blackmanHarris(units::TWO_PI * static_cast<double>(i) / static_cast<double>(n));
  return window;
}

Spectrogram spectrogramOf(const Recording& recording, double window_seconds) {
  const auto length = static_cast<std::size_t>(window_seconds * recording.sample_rate);
  const std::size_t hop = length / 2, samples = recording.channels[0].size();
  const std::vector<double> window = taper(length);
  Spectrogram result;
  const double step = recording.sample_rate / static_cast<double>(length);
  const auto lines = static_cast<std::size_t>(std::min(HIGHEST, 0.45 * recording.sample_rate) / step);
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

/// Median over the lines beside each: broadband noise, whatever lines stand in it.
std::vector<double> floorOf(const std::vector<double>& power) {
  constexpr std::size_t REACH = 40, STRIDE = 4;
  std::vector<double> floor(power.size());
  for (std::size_t k = 0; k < power.size(); k += STRIDE) {
    const std::size_t from = k > REACH ? k - REACH : 0, to = std::min(power.size(), k + REACH);
    std::vector<double> near(power.begin() + static_cast<std::ptrdiff_t>(from),
                             power.begin() + static_cast<std::ptrdiff_t>(to));
    const auto middle = near.begin() + static_cast<std::ptrdiff_t>(near.size() / 2);
    std::nth_element(near.begin(), middle, near.end());
    for (std::size_t i = k; i < std::min(k + STRIDE, power.size()); ++i) floor[i] = std::max(1e-30, *middle);
  }
  return floor;
}

class Judge {
 public:
  Judge(const Recording& recording, const RecordingRequest& request) : request_(request) {
    const double seconds = static_cast<double>(recording.channels[0].size()) / recording.sample_rate;
    const double turn = units::TWO_PI / request.speed;
    const double window =
        std::min(std::clamp(TURNS * turn, LEAST_WINDOW, LONGEST_WINDOW), 2.0 * seconds / (LEAST_WINDOWS + 1));
    if (window < 8.0 * turn)
      throw Error(formatted("recording: %.2f s hold %.0f revolutions, %d at least are due", seconds,
                            seconds / turn, 8 * (LEAST_WINDOWS + 1) / 2));
    verdict_.spectrogram = spectrogramOf(recording, window);
    step_ = verdict_.spectrogram.frequency[1];
  }

  RecordingVerdict run() {
    findCut();
    in_cut_ = mean(true);
    air_ = mean(false);
    floor_ = floorOf(in_cut_);
    findSpeed();
    findLines();
    verdict_.cut = parts_ || verdict_.chatter || inStep();
    if (!verdict_.cut) verdict_.reason = "nothing is heard that cuts";
    return verdict_;
  }

 private:
  struct Line {
    double frequency, power;
    std::size_t at;
  };
  const std::vector<std::vector<double>>& windows() const { return verdict_.spectrogram.power; }
  std::size_t lineAt(double frequency) const {
    return std::min(in_cut_.size() - 1, static_cast<std::size_t>(std::lround(frequency / step_)));
  }
  double passing() const { return request_.teeth * verdict_.speed / units::TWO_PI; }  // [Hz]

  /// Loud windows and quiet ones, by Otsu's threshold on the log of their power.
  void findCut() {
    std::vector<double> level;
    for (const std::vector<double>& power : windows()) {
      double sum = 0.0;
      for (auto k = static_cast<std::size_t>(LOWEST / step_); k < power.size(); ++k) sum += power[k];
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
    parts_ = contrast > std::log(CONTRAST);
    for (std::size_t w = 0; w < level.size(); ++w) cut_.push_back(!parts_ || level[w] > threshold);
    if (parts_ && !teethPart()) {
      parts_ = false;
      cut_.assign(level.size(), true);
    }
    const auto first = std::find(cut_.begin(), cut_.end(), true) - cut_.begin();
    const auto last = cut_.rend() - std::find(cut_.rbegin(), cut_.rend(), true) - 1;
    verdict_.from = verdict_.spectrogram.time[static_cast<std::size_t>(first)];
    verdict_.to = verdict_.spectrogram.time[static_cast<std::size_t>(last)];
  }

  /// Louder because the teeth are in it, for a while, and not because a vibration grows in the cut.
  bool teethPart() {
    constexpr double TEETH = 3.0;   // [x] power
    constexpr double LEAST = 0.12;  // [1] of the windows
    const auto loud = static_cast<double>(std::count(cut_.begin(), cut_.end(), true));
    const double all = static_cast<double>(cut_.size());
    if (std::min(loud, all - loud) < std::max(2.0, LEAST * all)) return false;
    const std::vector<double> cut = mean(true), air = mean(false);
    double in = 0.0, out = 0.0;
    const double tooth = request_.teeth * request_.speed / units::TWO_PI;
    for (double f = tooth; f < verdict_.spectrogram.frequency.back(); f += tooth) {
      const double reach = request_.speed_error * f + MAIN_LOBE * step_;
      if (f < LOWEST) continue;
      if (reach > 0.25 * tooth) break;  // higher ones cannot be told apart
      const auto from = static_cast<std::size_t>((f - reach) / step_);
      const auto to = std::min(cut.size() - 1, static_cast<std::size_t>((f + reach) / step_));
      for (std::size_t k = from; k <= to; ++k) {
        in += cut[k];
        out += air[k];
      }
    }
    return in > TEETH * out;
  }

  /// Mean over the windows of one kind whose neighbours are of that kind too; all of the kind where there is
  /// none. Empty: none of that kind.
  std::vector<double> mean(bool cut) const {
    std::vector<double> sum(verdict_.spectrogram.frequency.size(), 0.0);
    for (const bool inner : {true, false}) {
      int count = 0;
      for (std::size_t w = 0; w < cut_.size(); ++w) {
        const bool same =
            cut_[w] == cut &&
            (!inner || ((w == 0 || cut_[w - 1] == cut) && (w + 1 == cut_.size() || cut_[w + 1] == cut)));
        if (!same) continue;
        ++count;
        for (std::size_t k = 0; k < sum.size(); ++k) sum[k] += windows()[w][k];
      }
      if (count == 0) continue;
      for (double& v : sum) v /= count;
      return sum;
    }
    return {};
  }

  /// How well tooth passings at a speed meet lines.
  double comb(double speed) const {
    const double tooth = request_.teeth * speed / units::TWO_PI;
    double score = 0.0;
    for (double f = tooth; f < verdict_.spectrogram.frequency.back(); f += tooth) {
      const std::size_t k = lineAt(f);
      if (f > LOWEST) score += std::log1p(in_cut_[k] / floor_[k]);
    }
    return score;
  }

  void findSpeed() {
    verdict_.speed = request_.speed;
    // A correction beyond what a spindle's load does has to say more.
    constexpr double LOADED = 0.005, BEYOND = 1.15;
    double best = comb(request_.speed);
    const double step = 0.3 * step_ / verdict_.spectrogram.frequency.back();
    for (double off = -request_.speed_error; off <= request_.speed_error; off += step) {
      const double speed = request_.speed * (1.0 + off);
      const double score = comb(speed) / (std::abs(off) > LOADED ? BEYOND : 1.0);
      if (!(score > best)) continue;
      best = score;
      verdict_.speed = speed;
    }
  }

  /// The teeth are heard, though nothing changes.
  bool inStep() const {
    constexpr double HEARD = 30.0;  // [x] of what is beside it
    int heard = 0;
    for (int k = 1; k <= 3; ++k) {
      const std::size_t at = lineAt(k * passing());
      heard += in_cut_[at] > HEARD * floor_[at];
    }
    return heard >= 2;
  }

  /// [Hz] to the nearest order of the turn.
  double offHarmonic(double frequency) const {
    return std::abs(std::remainder(frequency, verdict_.speed / units::TWO_PI));
  }

  bool narrowLine(std::size_t k) const {
    constexpr std::size_t BESIDE = 6;
    if (k < BESIDE + 2 || k + BESIDE + 2 >= in_cut_.size()) return false;
    const double p = in_cut_[k];
    if (p < LINE * floor_[k] || p < in_cut_[k - 1] || p < in_cut_[k + 1]) return false;
    const auto beside = [&](std::size_t at) {
      return (in_cut_[at - 1] + in_cut_[at] + in_cut_[at + 1]) / 3.0;
    };
    // On one side a harmonic may stand.
    return std::min(beside(k - BESIDE), beside(k + BESIDE)) < NARROW * p;
  }

  double overAir(std::size_t k) const {
    if (!parts_ || air_.empty()) return RecordingVerdict::UNKNOWN;
    return in_cut_[k] / std::max({air_[k - 1], air_[k], air_[k + 1], 1e-30});
  }

  /// In most of the cut's windows it stands where it stands in their mean.
  bool stands(std::size_t k) const {
    int cut = 0, there = 0;
    for (std::size_t w = 0; w < cut_.size(); ++w) {
      if (!cut_[w]) continue;
      ++cut;
      const std::vector<double>& power = windows()[w];
      const double here = std::max({power[k - 1], power[k], power[k + 1]});
      constexpr std::size_t FAR = 12, WIDE = 6;
      double beside = 0.0;
      for (std::size_t i = 0; i < WIDE; ++i)
        beside += (power[k > FAR + i ? k - FAR - i : 0] + power[std::min(power.size() - 1, k + FAR + i)]) /
                  (2.0 * WIDE);
      there += here > PRESENT * std::min(beside, floor_[k] * 3.0);
    }
    return there >= STANDS * cut;
  }

  /// Lines that belong to one.
  struct Family {
    int companions = 0;
    bool adjacent = false;  // one of them is a single tooth passing away
    double power = 0.0;
  };
  Family familyOf(const Line& line, const std::vector<Line>& lines) const {
    Family family;
    family.power = line.power;
    for (const Line& other : lines) {
      if (&other == &line || !sameFamily(line, other)) continue;
      const double order = (other.frequency - line.frequency) / passing();
      const bool apart = std::abs(order - std::round(order)) * passing() < tolerance(line, other);
      if (apart && std::abs(order) > COMPANIONS + 0.5) continue;
      ++family.companions;
      family.adjacent = family.adjacent || (apart && std::abs(std::round(order)) == 1.0);
      family.power += other.power;
    }
    return family;
  }

  bool nearMode(double frequency, double* mode) const {
    for (const double f : request_.modes) {
      if (frequency < (1.0 - BELOW_MODE) * f || frequency > (1.0 + ABOVE_MODE) * f) continue;
      *mode = f;
      return true;
    }
    return false;
  }

  void findLines() {
    std::vector<Line> lines;
    double harmonics = 0.0;
    int alone_in_air = 0;
    for (std::size_t k = 1; k + 1 < in_cut_.size(); ++k) {
      const double f = verdict_.spectrogram.frequency[k];
      if (f < LOWEST) continue;
      const bool beside = offHarmonic(f) < MAIN_LOBE * step_ + SPREAD * f;
      // The flank of a harmonic has no peak of its own.
      const bool line = narrowLine(k) && offHarmonic(vertex(k)) > step_ + DRIFT * f;
      if (beside && !line) harmonics += std::max(0.0, in_cut_[k] - floor_[k]);
      if (!line || !stands(k)) continue;
      if (parts_ && overAir(k) < AIR) {
        ++alone_in_air;
        continue;
      }
      // Its main lobe is about four lines of the mean wide.
      lines.push_back({vertex(k), 2.0 * in_cut_[k], k});
    }
    decide(lines, harmonics, alone_in_air);
  }

  void decide(const std::vector<Line>& lines, double harmonics, int in_air) {
    const Line* best = nullptr;
    double best_power = 0.0;
    bool weak = false, lonely = false, far = false;
    for (const Line& line : lines) {
      const Family family = familyOf(line, lines);
      double mode = RecordingVerdict::UNKNOWN;
      const double share = family.power / std::max(1e-30, harmonics);
      bool near = nearMode(line.frequency, &mode);
      for (const Line& other : lines) {
        double off = RecordingVerdict::UNKNOWN;
        if (family.companions > 0 && sameFamily(line, other)) near = near || nearMode(other.frequency, &off);
        if (std::isnan(mode)) mode = off;
      }
      const bool due = request_.modes.empty() || near;
      // Without air to compare with, another machine's tone is told by its loneliness alone.
      const bool belongs = parts_ ? family.companions > 0 || std::isfinite(mode) || share > STRONG
                                  : family.companions > 1 || family.adjacent;
      weak = weak || share < LEAST_SHARE;
      lonely = lonely || !belongs;
      far = far || !due;
      if (share < LEAST_SHARE || !belongs || !due || line.power <= best_power) continue;
      best = &line;
      best_power = line.power;
      verdict_.companions = family.companions;
      verdict_.share = share;
      verdict_.mode = mode;
    }
    verdict_.chatter = best != nullptr;
    if (best) {
      verdict_.frequency = vertex(best->at);
      verdict_.over_noise = decibel(in_cut_[best->at] / floor_[best->at]);
      verdict_.over_air = parts_ ? decibel(overAir(best->at)) : RecordingVerdict::UNKNOWN;
    }
    verdict_.reason = best     ? ""
                      : far    ? "lines beside the harmonics are near no mode"
                      : lonely ? "a line beside the harmonics has no companions a tooth passing away"
                      : weak   ? "lines beside the harmonics are weak"
                      : in_air ? "lines beside the harmonics sound out of the cut too"
                               : "no line beside the harmonics";
  }

  double tolerance(const Line& a, const Line& b) const {
    return APART * step_ + DRIFT * std::max(a.frequency, b.frequency);
  }

  /// A whole number of tooth passings apart; of a real signal the mirrored lines belong to it as well.
  bool sameFamily(const Line& a, const Line& b) const {
    for (const double sign : {1.0, -1.0})
      if (std::abs(std::remainder(b.frequency - sign * a.frequency, passing())) < tolerance(a, b))
        return true;
    return false;
  }

  /// [Hz] of the parabola through the logarithms.
  double vertex(std::size_t k) const {
    const double a = std::log(in_cut_[k - 1] + 1e-300), b = std::log(in_cut_[k] + 1e-300),
                 c = std::log(in_cut_[k + 1] + 1e-300);
    const double curve = a - 2.0 * b + c;
    return step_ *
           (static_cast<double>(k) + (curve < 0.0 ? std::clamp(0.5 * (a - c) / curve, -0.5, 0.5) : 0.0));
  }

  RecordingRequest request_;
  RecordingVerdict verdict_;
  double step_ = 0.0;   // [Hz] between lines
  bool parts_ = false;  // cutting and not cutting are told apart
  std::vector<bool> cut_;
  std::vector<double> in_cut_, air_, floor_;
};

}  // namespace

void RecordingRequest::validate() const {
  if (!(speed > 0.0) || !std::isfinite(speed)) throw Error("recording: a speed above 0 is due");
  if (teeth < 1 || teeth > 40) throw Error("recording: 1 to 40 teeth are due");
  if (!(speed_error >= 0.0) || speed_error > 0.1)
    throw Error("recording: an error of the speed of 0 to 10 % is due");
}

std::string RecordingVerdict::text() const {
  const std::string where =
      formatted(" (%.0f rpm, %.2f .. %.2f s)", units::rpmFromRadPerSec(speed), from, to);
  if (!cut) return "no cut: " + reason;
  if (!chatter) return "stable: " + reason + where;
  std::string line = formatted("chatter at %.1f Hz, %.0f dB over the noise", frequency, over_noise);
  if (std::isfinite(over_air)) line += formatted(", %.0f dB over the air", over_air);
  line += formatted(", %d companions, %.1f times the harmonics' power", companions, share);
  if (std::isfinite(mode)) line += formatted(", near the mode at %.0f Hz", mode);
  return line + where;
}

RecordingVerdict judgeRecording(const Recording& recording, const RecordingRequest& request) {
  request.validate();
  if (!(recording.sample_rate > 0.0) || recording.channels.empty() || recording.channels[0].empty())
    throw Error("recording: samples and their rate are due");
  for (const std::vector<double>& channel : recording.channels)
    if (channel.size() != recording.channels[0].size())
      throw Error("recording: channels of different length");
  if (request.teeth * request.speed / units::TWO_PI > 0.2 * recording.sample_rate)
    throw Error(
        formatted("recording: %.0f samples a second do not show the tooth passings", recording.sample_rate));
  return Judge(recording, request).run();
}

}  // namespace smartmill::stability
