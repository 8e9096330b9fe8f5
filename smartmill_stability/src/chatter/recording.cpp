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

constexpr double LOWEST = 80.0, HIGHEST = 6000.0;            // [Hz] band of the analysis
constexpr double TURNS = 32.0;                               // revolutions of a window
constexpr double LEAST_WINDOW = 0.08, LONGEST_WINDOW = 0.8;  // [s]
constexpr int LEAST_WINDOWS = 5;
constexpr double MAIN_LOBE = 3.5;     // [lines] half width of the main lobe of the window
constexpr double SPREAD = 0.0015;     // [1] relative variation of the spindle speed
constexpr double LINE = 14.0;         // [1] least power of a line over the noise floor
constexpr double NARROW = 0.06;       // [1] largest power next to a line over its power
constexpr double AIR = 6.0;           // [1] least power over that of the same line outside the cut
constexpr double PRESENT = 5.0;       // [1] least power over the surroundings in one window
constexpr double STEADY = 0.6;        // [1] least fraction of the windows of the cut
constexpr double CONTRAST = 1.8;      // [1] least power of the cut over that of the rest
constexpr double STRONG = 0.3;        // [1] power over the harmonics above which no companion is required
constexpr double LEAST_SHARE = 0.02;  // [1] least power over the harmonics
constexpr double BELOW_MODE = 0.06, ABOVE_MODE = 0.15;  // [1] range around a mode; chatter is mostly above it
constexpr double LINE_ERROR = 0.5, DRIFT = 0.0006;  // [lines], [1]: tolerance of the distance of companions
constexpr int COMPANIONS = 4;                       // tooth passing frequencies to each side

double decibel(double ratio) {
  return 10.0 * std::log10(std::max(1e-30, ratio));
}

/// Blackman-Harris window: the side lobes of strong harmonics stay below chatter lines.
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

/// Noise floor: running median over neighbouring lines, insensitive to single lines.
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

class RecordingAnalysis {
 public:
  RecordingAnalysis(const Recording& recording, const RecordingRequest& request) : request_(request) {
    const double seconds = static_cast<double>(recording.channels[0].size()) / recording.sample_rate;
    const double turn = units::TWO_PI / request.speed;
    const double window =
        std::min(std::clamp(TURNS * turn, LEAST_WINDOW, LONGEST_WINDOW), 2.0 * seconds / (LEAST_WINDOWS + 1));
    if (window < 8.0 * turn)
      throw Error(formatted("recording: %.2f s with %.0f revolutions: expected at least %d revolutions",
                            seconds, seconds / turn, 8 * (LEAST_WINDOWS + 1) / 2));
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
    verdict_.cut = has_air_ || verdict_.chatter || hasToothPassing();
    if (!verdict_.cut) verdict_.reason = "no louder part and no lines at the tooth passing frequency";
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

  /// Separates loud from quiet windows, by Otsu's threshold on the logarithm of their power.
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
    has_air_ = contrast > std::log(CONTRAST);
    for (std::size_t w = 0; w < level.size(); ++w) cut_.push_back(!has_air_ || level[w] > threshold);
    if (has_air_ && !loudFromTeeth()) {
      has_air_ = false;
      cut_.assign(level.size(), true);
    }
    const auto first = std::find(cut_.begin(), cut_.end(), true) - cut_.begin();
    const auto last = cut_.rend() - std::find(cut_.rbegin(), cut_.rend(), true) - 1;
    verdict_.from = verdict_.spectrogram.time[static_cast<std::size_t>(first)];
    verdict_.to = verdict_.spectrogram.time[static_cast<std::size_t>(last)];
  }

  /// Whether the loud windows are louder at the tooth passing frequency: a cut, not a vibration that grows
  /// within a cut.
  bool loudFromTeeth() {
    constexpr double TEETH = 3.0;   // [1] power ratio
    constexpr double LEAST = 0.12;  // [1] least fraction of the windows of either kind
    const auto loud = static_cast<double>(std::count(cut_.begin(), cut_.end(), true));
    const double all = static_cast<double>(cut_.size());
    if (std::min(loud, all - loud) < std::max(2.0, LEAST * all)) return false;
    const std::vector<double> cut = mean(true), air = mean(false);
    double in = 0.0, out = 0.0;
    const double tooth = request_.teeth * request_.speed / units::TWO_PI;
    for (double f = tooth; f < verdict_.spectrogram.frequency.back(); f += tooth) {
      const double reach = request_.speed_error * f + MAIN_LOBE * step_;
      if (f < LOWEST) continue;
      if (reach > 0.25 * tooth) break;  // higher harmonics are not resolved
      const auto from = static_cast<std::size_t>((f - reach) / step_);
      const auto to = std::min(cut.size() - 1, static_cast<std::size_t>((f + reach) / step_));
      for (std::size_t k = from; k <= to; ++k) {
        in += cut[k];
        out += air[k];
      }
    }
    return in > TEETH * out;
  }

  /// Mean spectrum of the windows in the cut or outside, without those at a transition unless there are no
  /// others. Empty without such windows.
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

  /// Agreement of the lines with the tooth passing harmonics at a speed.
  double combScore(double speed) const {
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
    // A correction larger than the effect of load must improve the score by the factor BEYOND.
    constexpr double LOADED = 0.005, BEYOND = 1.15;
    double best = combScore(request_.speed);
    const double step = 0.3 * step_ / verdict_.spectrogram.frequency.back();
    for (double off = -request_.speed_error; off <= request_.speed_error; off += step) {
      const double speed = request_.speed * (1.0 + off);
      const double score = combScore(speed) / (std::abs(off) > LOADED ? BEYOND : 1.0);
      if (!(score > best)) continue;
      best = score;
      verdict_.speed = speed;
    }
  }

  /// Whether tooth passing harmonics are present.
  bool hasToothPassing() const {
    constexpr double LEAST = 30.0;  // [1] power over the noise floor
    int found = 0;
    for (int k = 1; k <= 3; ++k) {
      const std::size_t at = lineAt(k * passing());
      found += in_cut_[at] > LEAST * floor_[at];
    }
    return found >= 2;
  }

  /// [Hz] Distance to the nearest spindle harmonic.
  double offHarmonic(double frequency) const {
    return std::abs(std::remainder(frequency, verdict_.speed / units::TWO_PI));
  }

  bool narrowLine(std::size_t k) const {
    constexpr std::size_t DISTANCE = 6;
    if (k < DISTANCE + 2 || k + DISTANCE + 2 >= in_cut_.size()) return false;
    const double p = in_cut_[k];
    if (p < LINE * floor_[k] || p < in_cut_[k - 1] || p < in_cut_[k + 1]) return false;
    const auto meanAt = [&](std::size_t at) {
      return (in_cut_[at - 1] + in_cut_[at] + in_cut_[at + 1]) / 3.0;
    };
    // A harmonic may be present on one side.
    return std::min(meanAt(k - DISTANCE), meanAt(k + DISTANCE)) < NARROW * p;
  }

  double overAir(std::size_t k) const {
    if (!has_air_ || air_.empty()) return RecordingVerdict::UNKNOWN;
    return in_cut_[k] / std::max({air_[k - 1], air_[k], air_[k + 1], 1e-30});
  }

  /// Whether a line of the mean spectrum is present at the same frequency in most windows of the cut.
  bool isSteady(std::size_t k) const {
    int cut = 0, present = 0;
    for (std::size_t w = 0; w < cut_.size(); ++w) {
      if (!cut_[w]) continue;
      ++cut;
      const std::vector<double>& power = windows()[w];
      const double here = std::max({power[k - 1], power[k], power[k + 1]});
      constexpr std::size_t FAR = 12, WIDE = 6;
      double around = 0.0;
      for (std::size_t i = 0; i < WIDE; ++i)
        around += (power[k > FAR + i ? k - FAR - i : 0] + power[std::min(power.size() - 1, k + FAR + i)]) /
                  (2.0 * WIDE);
      present += here > PRESENT * std::min(around, floor_[k] * 3.0);
    }
    return present >= STEADY * cut;
  }

  /// Lines that differ from one line by an integer number of tooth passing frequencies.
  struct Family {
    int companions = 0;
    bool adjacent = false;  // one of them is one tooth passing frequency away
    double power = 0.0;
  };
  Family familyOf(const Line& line, const std::vector<Line>& lines) const {
    Family family;
    family.power = line.power;
    for (const Line& other : lines) {
      if (&other == &line || !sameFamily(line, other)) continue;
      const double order = (other.frequency - line.frequency) / passing();
      const bool integer = std::abs(order - std::round(order)) * passing() < tolerance(line, other);
      if (integer && std::abs(order) > COMPANIONS + 0.5) continue;
      ++family.companions;
      family.adjacent = family.adjacent || (integer && std::abs(std::round(order)) == 1.0);
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
    int lines_in_air = 0;
    for (std::size_t k = 1; k + 1 < in_cut_.size(); ++k) {
      const double f = verdict_.spectrogram.frequency[k];
      if (f < LOWEST) continue;
      const bool near_harmonic = offHarmonic(f) < MAIN_LOBE * step_ + SPREAD * f;
      // The flank of a harmonic has no peak of its own.
      const bool line = narrowLine(k) && offHarmonic(vertex(k)) > step_ + DRIFT * f;
      if (near_harmonic && !line) harmonics += std::max(0.0, in_cut_[k] - floor_[k]);
      if (!line || !isSteady(k)) continue;
      if (has_air_ && overAir(k) < AIR) {
        ++lines_in_air;
        continue;
      }
      // The power of the main lobe is about twice that of its peak line.
      lines.push_back({vertex(k), 2.0 * in_cut_[k], k});
    }
    decide(lines, harmonics, lines_in_air);
  }

  void decide(const std::vector<Line>& lines, double harmonics, int lines_in_air) {
    const Line* best = nullptr;
    double best_power = 0.0;
    bool weak = false, single = false, far = false;
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
      const bool possible = request_.modes.empty() || near;
      // Without air for comparison, a tone of another machine is identified only by the lack of companions.
      const bool belongs = has_air_ ? family.companions > 0 || std::isfinite(mode) || share > STRONG
                                    : family.companions > 1 || family.adjacent;
      weak = weak || share < LEAST_SHARE;
      single = single || !belongs;
      far = far || !possible;
      if (share < LEAST_SHARE || !belongs || !possible || line.power <= best_power) continue;
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
      verdict_.over_air = has_air_ ? decibel(overAir(best->at)) : RecordingVerdict::UNKNOWN;
    }
    verdict_.reason = best  ? ""
                      : far ? "lines outside the harmonics are not near a mode"
                      : single
                          ? "lines outside the harmonics have no companions one tooth passing frequency away"
                      : weak         ? "lines outside the harmonics are weak"
                      : lines_in_air ? "lines outside the harmonics are also present outside the cut"
                                     : "no lines outside the harmonics";
  }

  double tolerance(const Line& a, const Line& b) const {
    return LINE_ERROR * step_ + DRIFT * std::max(a.frequency, b.frequency);
  }

  /// Whether two lines differ by an integer number of tooth passing frequencies, mirrored lines included.
  bool sameFamily(const Line& a, const Line& b) const {
    for (const double sign : {1.0, -1.0})
      if (std::abs(std::remainder(b.frequency - sign * a.frequency, passing())) < tolerance(a, b))
        return true;
    return false;
  }

  /// [Hz] Vertex of the parabola through the logarithms.
  double vertex(std::size_t k) const {
    const double a = std::log(in_cut_[k - 1] + 1e-300), b = std::log(in_cut_[k] + 1e-300),
                 c = std::log(in_cut_[k + 1] + 1e-300);
    const double curve = a - 2.0 * b + c;
    return step_ *
           (static_cast<double>(k) + (curve < 0.0 ? std::clamp(0.5 * (a - c) / curve, -0.5, 0.5) : 0.0));
  }

  RecordingRequest request_;
  RecordingVerdict verdict_;
  double step_ = 0.0;     // [Hz] between lines
  bool has_air_ = false;  // the recording contains windows outside the cut
  std::vector<bool> cut_;
  std::vector<double> in_cut_, air_, floor_;
};

}  // namespace

void RecordingRequest::validate() const {
  if (!(speed > 0.0) || !std::isfinite(speed))
    throw Error(formatted("recording: spindle speed %g rad/s: expected a value above 0", speed));
  if (teeth < 1 || teeth > 40) throw Error(formatted("recording: %d teeth: expected 1 to 40", teeth));
  if (!(speed_error >= 0.0) || speed_error > 0.1)
    throw Error(formatted("recording: speed error %g %%: expected 0 to 10 %%", 100.0 * speed_error));
}

std::string RecordingVerdict::text() const {
  const std::string where =
      formatted(" (%.0f rpm, %.2f .. %.2f s)", units::rpmFromRadPerSec(speed), from, to);
  if (!cut) return "no cut: " + reason;
  if (!chatter) return "stable: " + reason + where;
  std::string line = formatted("chatter at %.1f Hz, %.0f dB above the noise floor", frequency, over_noise);
  if (std::isfinite(over_air)) line += formatted(", %.0f dB above the level outside the cut", over_air);
  line += formatted(", %d companions, %.1f times the power of the harmonics", companions, share);
  if (std::isfinite(mode)) line += formatted(", near the mode at %.0f Hz", mode);
  return line + where;
}

RecordingVerdict judgeRecording(const Recording& recording, const RecordingRequest& request) {
  request.validate();
  if (!(recording.sample_rate > 0.0) || recording.channels.empty() || recording.channels[0].empty())
    throw Error("recording: expected samples and a sample rate above 0");
  for (const std::vector<double>& channel : recording.channels)
    if (channel.size() != recording.channels[0].size())
      throw Error("recording: channels of different length: expected equal lengths");
  if (request.teeth * request.speed / units::TWO_PI > 0.2 * recording.sample_rate)
    throw Error(formatted(
        "recording: sample rate %.0f Hz: expected at least 5 times the tooth passing frequency, %.0f Hz",
        recording.sample_rate, request.teeth * request.speed / units::TWO_PI));
  return RecordingAnalysis(recording, request).run();
}

}  // namespace smartmill::stability
