#include "smartmill_stability/chatter/recording.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <numeric>
#include <optional>

#include "chatter/cut_finder.h"
#include "chatter/order_powers.h"
#include "chatter/spectrogram.h"
#include "chatter/speed_finder.h"
#include "smartmill_core/error.h"
#include "smartmill_core/formatted.h"
#include "smartmill_core/signal/chatter_criterion.h"
#include "smartmill_core/signal/revolution_window.h"
#include "smartmill_core/signal/statistics.h"
#include "smartmill_core/units.h"
#include "smartmill_stability/chatter/chatter_advice.h"

namespace smartmill::stability {
namespace {

using Reason = ChatterEvidence::Reason;
using Kind = RecordingVerdict::Kind;

/// [1] Relative variation of the spindle speed within a window, and error of its correction.
constexpr double SPEED_ERROR = 6e-4;

constexpr double NOT_KNOWN = 0.5;  ///< [1] probability of what the recording does not distinguish
/// Probability of chatter from the mean margin m of the windows: 1 / (1 + exp(-SLOPE m)).
constexpr double SLOPE = 2.0;
constexpr double ALIASED_TO = 2.0;  ///< [sample rates] harmonics above are weak
/// Without a sign that teeth cut nothing is cut below this probability of chatter, unless the vibration
/// between the spindle harmonics has this many times their power, which no bearing of an idle spindle has.
constexpr double NO_CUT_BELOW = 0.4, LOUD = 50.0;
/// The same of a single edge (turning, fly cutting), which has no harmonics that distinguish a cut.
constexpr double LOUD_SINGLE = 10.0;
constexpr double SAME_RATE = 1e-3;     ///< [1] difference of the sample rates of recording and idle recording
constexpr double LEAST_TURNS = 3.0;    ///< [revolutions] of a recording
constexpr double SPEED_TURNS = 12.0;   ///< [revolutions] for the speed from the harmonics
constexpr double WINDOW_TURNS = 36.0;  ///< [revolutions] of a recording that is divided into windows
constexpr double FINE_SAMPLES = 12.0;  ///< [1] in a tooth passing period, for the interpolation of windows

double decibel(double ratio) {
  return 10.0 * std::log10(std::max(1e-30, ratio));
}

const char* textOf(Reason reason) {
  switch (reason) {
    case Reason::none:
      return "";
    case Reason::no_lines:
      return "no lines outside the harmonics";
    case Reason::in_background:
      return "lines outside the harmonics are also present outside the cut";
    case Reason::weak:
      return "vibration outside the harmonics is weak";
    case Reason::decays:
      return "vibration outside the harmonics decays";
    case Reason::single:
      return "lines outside the harmonics have no companions one tooth passing frequency away";
    case Reason::far_from_modes:
      return "lines outside the harmonics are not near a mode";
  }
  return "";
}

/// [rad/s] Speed of a recording of few revolutions: the least energy does not repeat with the revolution.
double repeatingSpeed(const Recording& recording, const RecordingRequest& request) {
  constexpr double MARGIN = 4.0;  // [samples] of the interpolation
  constexpr int STEPS = 20;       // to each side
  double best = request.speed, least = std::numeric_limits<double>::infinity();
  const double slowest = (1.0 - request.speed_error) * request.speed;
  const auto samples = static_cast<double>(recording.channels[0].size()) - MARGIN;
  const auto turns = static_cast<std::size_t>(samples / recording.sample_rate * slowest / units::TWO_PI);
  for (int step = -STEPS; turns > 1 && step <= STEPS; ++step) {
    const double speed = request.speed * (1.0 + request.speed_error * step / STEPS);
    if (samples / recording.sample_rate * speed < LEAST_TURNS * units::TWO_PI) continue;
    const double revolution = units::TWO_PI / speed * recording.sample_rate;
    RevolutionWindow window(static_cast<std::size_t>(std::ceil(revolution)), turns, request.teeth);
    for (const std::vector<double>& channel : recording.channels) window.add(channel, 1.0, revolution);
    if (!(window.remainder() < least)) continue;
    least = window.remainder();
    best = speed;
  }
  return best;
}

/// Spectrogram of a recording that is not divided into windows, for its picture.
Spectrogram pictureOf(const Recording& recording) {
  constexpr double PARTS = 4.0;
  const CutFinderOptions options;
  const double seconds = static_cast<double>(recording.channels[0].size()) / recording.sample_rate;
  return spectrogramOf(recording, std::min(options.longest_window, seconds / PARTS), options.highest);
}

/// [Hz] @throws Error if the samples do not resolve it
double toothPassing(const Recording& recording, int teeth, double speed) {
  const double passing = teeth * speed / units::TWO_PI;
  if (2.0 * passing > recording.sample_rate)
    throw Error(formatted(
        "recording: sample rate %.0f Hz: expected at least twice the tooth passing frequency, %.0f Hz",
        recording.sample_rate, passing));
  return passing;
}

struct SpindleSpeed {
  double value = NAN;  // [rad/s]; NaN: unknown
  RecordingVerdict::SpeedSource source = RecordingVerdict::SpeedSource::stated;
  /// SpeedFinder::teethDominate(); unknown for a recording of few revolutions.
  std::optional<bool> teeth_dominate{};
};

/// The stated speed, unless none is stated or the harmonics agree much better with another one.
SpindleSpeed speedOf(const Recording& recording, const RecordingRequest& request) {
  using Source = RecordingVerdict::SpeedSource;
  constexpr double LEAST_AGREEMENT = 12.0;  // [1] chance agrees with 8 at most among all speeds
  constexpr double CORRECTED = 2.0;         // [1] agreement over that, of another speed than the stated one
  constexpr double WINDOWS = 2.0;
  const CutFinderOptions band;
  const double seconds = static_cast<double>(recording.channels[0].size()) / recording.sample_rate;
  const bool stated = request.speed > 0.0;
  if (stated && seconds * request.speed < WINDOW_TURNS * units::TWO_PI)
    return {repeatingSpeed(recording, request), Source::stated};
  const double window = std::min(band.longest_window, seconds / WINDOWS);
  const SpeedFinder finder(loudPower(spectrogramOf(recording, window, band.highest)), 1.0 / window,
                           band.lowest, request.teeth);
  if (!(finder.lowestSpeed() < finder.highestSpeed())) return {stated ? request.speed : NAN, Source::stated};
  if (!stated) {
    const double found = finder.anywhere();
    return {finder.agreement(found) > LEAST_AGREEMENT ? found : NAN, Source::found,
            finder.teethDominate(found)};
  }
  // Load reduces the speed by less than this; a larger correction has to agree better.
  // Aliased lines agree with other speeds by chance.
  constexpr double LOADED = 0.005, BEYOND = 1.15, ALIASED = 1.5;
  const bool aliased = recording.sample_rate * units::TWO_PI < FINE_SAMPLES * request.teeth * request.speed;
  const auto within = [&](double error) {
    return finder.best((1.0 - error) * request.speed, (1.0 + error) * request.speed);
  };
  double near = within(std::min(LOADED, request.speed_error));
  if (const double farther = within(request.speed_error);
      finder.agreement(farther) > (aliased ? ALIASED : BEYOND) * finder.agreement(near))
    near = farther;
  if (finder.agreement(near) < LEAST_AGREEMENT) {
    const double other = finder.anywhere();
    if (finder.agreement(other) > CORRECTED * LEAST_AGREEMENT)
      return {other, Source::corrected, finder.teethDominate(other)};
  }
  return {near, Source::stated, finder.teethDominate(near)};
}

/// Applies ChatterCriterion to windows of whole revolutions of the cut.
class RecordingAnalysis {
 public:
  /// @param aliased [Hz] lines at aliased harmonics
  RecordingAnalysis(const Recording& recording, const RecordingRequest& request,
                    std::optional<bool> teeth_dominate, const std::vector<double>& aliased)
      : recording_(recording),
        cut_(recording, request),
        criterion_(optionsOf(request, aliased)),
        teeth_(request.teeth),
        teeth_dominate_(teeth_dominate),
        period_(units::TWO_PI / request.speed),
        revolution_(period_ * recording.sample_rate),
        turns_(static_cast<std::size_t>(cut_.window() / period_)) {
    double largest = 0.0;
    for (const std::vector<double>& channel : recording_.channels)
      largest = std::max(largest, standardDeviation(channel));
    for (const std::vector<double>& channel : recording_.channels) {
      const double deviation = standardDeviation(channel);
      if (!(deviation > 0.0)) continue;
      const double unit = recording_.same_unit ? largest : deviation;
      channels_.push_back(scaled(channel, unit));
      if (!request.idle.channels.empty())
        idle_.push_back(scaled(
            request.idle.channels[static_cast<std::size_t>(&channel - recording_.channels.data())], unit));
    }
  }

  RecordingVerdict run() {
    const std::vector<RevolutionWindow> windows = windowsAt(channels_, startsWithin(true));
    const Level cut = meanOf(windows);
    const Level background = this->background();
    idle_level_ = background.total;
    const std::vector<double> lines = withoutCut(background, cut);
    for (const RevolutionWindow& window : windows) {
      addOrders(window);
      level_ += window.total();
      add(criterion_.judge(window, period_, lines));
    }
    return verdict();
  }

 private:
  static ChatterCriterionOptions optionsOf(const RecordingRequest& request,
                                           const std::vector<double>& aliased) {
    const CutFinderOptions band;
    ChatterCriterionOptions options;
    options.lowest_frequency = band.lowest;
    options.highest_frequency = band.highest;
    options.speed_error = SPEED_ERROR;
    options.modes = request.modes;
    options.ignored = aliased;
    // Without a known cut the orders of an idle spindle cannot be distinguished from a flip.
    options.alternation_ratio = 1.0;
    return options;
  }

  /// [samples] Starts of the windows, half a window apart, that lie entirely in the cut or outside; without
  /// any those with their middle there.
  std::vector<double> startsWithin(bool cut) const {
    std::vector<double> starts;
    const double length = revolution_ * static_cast<double>(turns_);
    const auto end = static_cast<double>(recording_.channels[0].size()) - 3.0;
    for (const double share : {1.0, 0.0}) {
      for (double start = 1.0; start + length < end; start += 0.5 * length) {
        const double middle = start + 0.5 * length, reach = 0.5 * share * length;
        if (cut_.within(cut, (middle - reach) / recording_.sample_rate,
                        (middle + reach) / recording_.sample_rate))
          starts.push_back(start);
      }
      if (!starts.empty()) break;
    }
    return starts;
  }

  std::vector<RevolutionWindow> windowsAt(const std::vector<std::vector<double>>& channels,
                                          const std::vector<double>& starts) const {
    std::vector<RevolutionWindow> windows;
    for (const double start : starts) {
      windows.emplace_back(static_cast<std::size_t>(std::ceil(revolution_)), turns_, teeth_);
      for (const std::vector<double>& channel : channels) windows.back().add(channel, start, revolution_);
    }
    return windows;
  }

  /// Mean over windows.
  struct Level {
    std::vector<double> lines;  // power of each line of the remainder; empty without windows
    double total = 0.0;         // variance
    double teeth = 0.0;         // power of the tooth passing harmonics
  };
  Level meanOf(const std::vector<RevolutionWindow>& windows) const {
    Level mean;
    const auto n = static_cast<double>(windows.size());
    for (const RevolutionWindow& window : windows) {
      mean.lines.resize(window.power().size(), 0.0);
      for (std::size_t k = 0; k < mean.lines.size(); ++k) mean.lines[k] += window.power()[k] / n;
      mean.total += window.total() / n;
      const auto teeth = static_cast<std::size_t>(teeth_);
      for (std::size_t k = teeth; k < window.ofOrder().size(); k += teeth)
        mean.teeth += window.ofOrder()[k] / n;
    }
    return mean;
  }

  /// Of the idle spindle, where it is recorded, or else of the windows outside the cut.
  Level background() const {
    if (idle_.empty())
      return meanOf(cut_.hasAir() ? windowsAt(channels_, startsWithin(false))
                                  : std::vector<RevolutionWindow>());
    const double length = revolution_ * static_cast<double>(turns_);
    std::vector<double> starts;
    for (double start = 1.0; start + length + 3.0 < static_cast<double>(idle_[0].size());
         start += 0.5 * length)
      starts.push_back(start);
    if (starts.empty())
      throw Error(formatted("idle recording: %zu samples: expected at least the %zu revolutions of a window",
                            idle_[0].size(), turns_));
    return meanOf(windowsAt(idle_, starts));
  }

  /// Lines of the background that are not those of a part of the cut in it (a tool that leaves the cut for
  /// less than a window): such a part has the tooth passing harmonics of the cut as well. A line that is as
  /// strong outside the cut keeps half its power at least, every line LEAST of it.
  static std::vector<double> withoutCut(const Level& background, const Level& cut) {
    constexpr double MOST = 0.5, LEAST = 0.05;  // [1]
    std::vector<double> lines = background.lines;
    if (!(cut.teeth > 0.0)) return lines;
    const double part = std::min(MOST, background.teeth / cut.teeth);
    for (std::size_t k = 0; k < std::min(lines.size(), cut.lines.size()); ++k)
      lines[k] = std::max(LEAST * lines[k], lines[k] - part * cut.lines[k]);
    return lines;
  }

  static std::vector<double> scaled(std::vector<double> channel, double unit) {
    for (double& value : channel) value /= unit;
    return channel;
  }

  void addOrders(const RevolutionWindow& window) {
    of_order_.resize(window.ofOrder().size(), 0.0);
    for (std::size_t k = 1; k < of_order_.size(); ++k)
      if (static_cast<double>(k) / period_ > CutFinderOptions().lowest) of_order_[k] += window.ofOrder()[k];
  }

  bool teethDominate() const {
    if (teeth_dominate_) return *teeth_dominate_;
    if (teeth_ == 1) return cut_.hasToothPassing();
    const OrderPowers powers = orderPowers(teeth_, [&](int order) {
      const auto k = static_cast<std::size_t>(order);
      return k < of_order_.size() ? of_order_[k] : 0.0;
    });
    return powers.teeth > powers.others;
  }

  /// Whether most of the synchronous power is at one order above that of the teeth that is not theirs:
  /// neither teeth nor runout do that, but chatter next to a spindle harmonic does. The speed of few
  /// revolutions may have been fitted to the chatter, so that a high order of the teeth is no better.
  bool harmonicLikeChatter() const {
    const auto strongest =
        static_cast<std::size_t>(std::max_element(of_order_.begin(), of_order_.end()) - of_order_.begin());
    const double all = std::accumulate(of_order_.begin(), of_order_.end(), 0.0);
    const auto teeth = static_cast<std::size_t>(teeth_);
    const bool of_teeth = strongest % teeth == 0 && (!brief() || strongest <= COMPARED_PASSINGS * teeth);
    return strongest > teeth && !of_teeth && 2.0 * of_order_[strongest] > all;
  }

  bool brief() const { return static_cast<double>(turns_) * static_cast<double>(windows_) < WINDOW_TURNS; }

  /// Signs that teeth cut: their harmonics are stronger than the other spindle harmonics, which an idle
  /// spindle has as well; a part of some length is louder; the vibration is modulated by the teeth.
  bool cuts() const {
    constexpr std::size_t LEAST_WINDOWS = 4;  // a slamming door is shorter
    if (!idle_.empty())
      return level_ > CutFinderOptions().contrast * static_cast<double>(windows_) * idle_level_;
    return teethDominate() || (cut_.hasAir() && windows_ >= LEAST_WINDOWS) || 2 * modulated_ > windows_;
  }

  void add(const ChatterEvidence& evidence) {
    ++windows_;
    ++reasons_[evidence.reason];
    synchronous_ += evidence.synchronous;
    between_ += std::pow(evidence.severity, 2);
    margins_ += evidence.margin;
    modulated_ += evidence.modulated && evidence.companions > 1;
    like_bearing_ += evidence.like_bearing;
    if (!evidence.chatter) return;
    // Consecutive windows agree on the frequency or on another line of the family, which excludes a run-up of
    // the spindle.
    bool steady = chattering_.empty();
    if (!steady) {
      const double before = chattering_.back().order;
      steady = std::abs(evidence.order - before) < SAME_CHATTER * before ||
               std::abs(std::remainder(evidence.order - before, 1.0)) < 1.0 / static_cast<double>(turns_);
    }
    if (!steady) margins_ -= evidence.margin + ChatterEvidence::LARGEST_MARGIN;
    chattering_.push_back(evidence);
  }

  /// Median over the windows with chatter.
  template <class Value>
  double medianOf(const Value& value) const {
    std::vector<double> values;
    for (const ChatterEvidence& evidence : chattering_) values.push_back(value(evidence));
    return median(values);
  }

  RecordingVerdict verdict() const {
    RecordingVerdict verdict;
    verdict.speed = units::TWO_PI / period_;
    verdict.from = cut_.from();
    verdict.to = cut_.to();
    verdict.spectrogram = cut_.spectrogram();
    if (verdict.spectrogram.time.size() < 2) verdict.spectrogram = pictureOf(recording_);
    if (windows_ == 0) return verdict;
    verdict.cut = cuts();
    verdict.margin = margins_ / static_cast<double>(windows_);
    verdict.energy_ratio = between_ / std::max(1e-30, between_ + synchronous_);
    const double probability = 1.0 / (1.0 + std::exp(-SLOPE * verdict.margin));
    if (!chattering_.empty()) describe(verdict);
    const bool bearing = 2 * like_bearing_ > windows_;
    if (!verdict.cut && !idle_.empty()) {
      verdict.kind = Kind::no_cut;
      verdict.reason = "no louder than the idle spindle";
      return verdict;
    }
    if (!verdict.cut) {
      const double loudness = between_ / std::max(1e-30, synchronous_);
      const double loud = teeth_ == 1 ? LOUD_SINGLE : LOUD;
      const bool quiet = loudness < 1.0 && !harmonicLikeChatter();
      if (quiet || (loudness < loud && !brief() && (probability < NO_CUT_BELOW || bearing))) {
        verdict.kind = Kind::no_cut;
        verdict.reason = bearing ? "lines modulated by the spindle, not by the teeth, as those of a bearing"
                         : teeth_ == 1 ? "no louder part: an idle spindle, or a quiet cut"
                         : cut_.hasToothPassing()
                             ? "other spindle harmonics are stronger than those of the teeth: an idle "
                               "spindle, or a cut with large runout"
                             : "no louder part and no lines at the tooth passing frequency";
        return verdict;
      }
      verdict.cut = loudness > loud;
    }
    verdict.probability = probability;
    if (!verdict.cut) {
      verdict.probability = NOT_KNOWN;
      verdict.reason = "vibration between the spindle harmonics, but no sign that teeth cut";
    } else if (bearing && probability > RecordingVerdict::CHATTER_ABOVE) {
      verdict.probability = NOT_KNOWN;
      verdict.reason = "lines modulated by the spindle, not by the teeth: chatter or a bearing";
    } else if (probability < RecordingVerdict::STABLE_BELOW && harmonicLikeChatter()) {
      verdict.probability = NOT_KNOWN;
      verdict.reason =
          "the strongest line is a spindle harmonic, but none of the teeth: chatter may coincide with it";
    } else {
      verdict.kind = probability < RecordingVerdict::STABLE_BELOW    ? Kind::stable
                     : probability > RecordingVerdict::CHATTER_ABOVE ? Kind::chatter
                                                                     : Kind::unsure;
      if (verdict.kind != Kind::chatter) verdict.reason = textOf(mostFrequentReason());
    }
    return verdict;
  }

  /// The family of chatter lines.
  void describe(RecordingVerdict& verdict) const {
    verdict.frequency = medianOf([&](const ChatterEvidence& e) { return e.order / period_; });
    verdict.over_noise = medianOf([](const ChatterEvidence& e) { return decibel(e.over_floor); });
    if (std::isfinite(chattering_.front().over_background))
      verdict.over_air = medianOf([](const ChatterEvidence& e) { return decibel(e.over_background); });
    verdict.companions = static_cast<int>(
        medianOf([](const ChatterEvidence& e) { return static_cast<double>(e.companions); }));
    double power = 0.0;
    for (const ChatterEvidence& e : chattering_) {
      power += e.power;
      if (std::isnan(verdict.mode)) verdict.mode = e.mode;
    }
    verdict.share = power / static_cast<double>(chattering_.size()) /
                    std::max(1e-30, synchronous_ / static_cast<double>(windows_));
  }

  Reason mostFrequentReason() const {
    Reason most = Reason::no_lines;
    std::size_t count = 0;
    for (const auto& [reason, windows] : reasons_) {
      if (reason == Reason::none || windows < count) continue;
      most = reason;
      count = windows;
    }
    return most;
  }

  const Recording& recording_;
  CutFinder cut_;
  ChatterCriterion criterion_;
  int teeth_;
  std::optional<bool> teeth_dominate_;
  double period_, revolution_;  // [s], [samples]
  std::size_t turns_;
  std::vector<std::vector<double>> channels_;  // with unit variance
  std::vector<std::vector<double>> idle_;      // on the same scale; empty: not recorded
  double level_ = 0.0, idle_level_ = 0.0;      // variance: sum over the windows, mean
  std::vector<double> of_order_;               // sum over the windows
  std::size_t windows_ = 0, modulated_ = 0, like_bearing_ = 0;
  double margins_ = 0.0;  // sum over the windows
  std::map<Reason, std::size_t> reasons_;
  double synchronous_ = 0.0, between_ = 0.0;  // sum of the mean squares at the spindle harmonics and between
  std::vector<ChatterEvidence> chattering_;
};

}  // namespace

void RecordingRequest::validate() const {
  if (!(speed >= 0.0) || !std::isfinite(speed))
    throw Error(formatted(
        "recording: spindle speed %g rad/s: expected a value above 0, or 0 for an unknown speed", speed));
  if (teeth < 1 || teeth > 40) throw Error(formatted("recording: %d teeth: expected 1 to 40", teeth));
  if (!(speed_error >= 0.0) || speed_error > 0.1)
    throw Error(formatted("recording: speed error %g %%: expected 0 to 10 %%", 100.0 * speed_error));
}

const char* nameOf(RecordingVerdict::Kind kind) {
  constexpr const char* NAMES[] = {"no_cut", "stable", "chatter", "unsure"};
  return NAMES[static_cast<int>(kind)];
}

std::string RecordingVerdict::text() const {
  std::string where = formatted(" (%.0f rpm", units::rpmFromRadPerSec(speed));
  if (speed_source == SpeedSource::found) where += " by the harmonics";
  if (speed_source == SpeedSource::corrected)
    where += " by the harmonics, which differs from the stated speed";
  where += formatted(", %.2f .. %.2f s)", from, to);
  if (kind == Kind::no_cut) return "no cut: " + reason;
  if (std::isnan(probability)) return "unsure: " + reason;
  const std::string probable = formatted(" (probability of chatter %.0f %%)", 100.0 * probability);
  if (kind == Kind::stable) return "stable" + probable + ": " + reason + where;
  std::string line = (kind == Kind::chatter ? "chatter" : "unsure") + probable;
  if (std::isfinite(frequency)) {
    line += formatted(" at %.1f Hz, %.0f dB above the noise floor", frequency, over_noise);
    if (std::isfinite(over_air)) line += formatted(", %.0f dB above the level outside the cut", over_air);
    line += formatted(", %d companions, %.1f times the power of the harmonics", companions, share);
  }
  if (std::isfinite(mode)) line += formatted(", near the mode at %.0f Hz", mode);
  if (!reason.empty()) line += ": " + reason;
  return line + where;
}

RecordingVerdict judgeRecording(const Recording& recording, const RecordingRequest& request) {
  request.validate();
  if (!(recording.sample_rate > 0.0) || recording.channels.empty() || recording.channels[0].empty())
    throw Error("recording: expected samples and a sample rate above 0");
  for (const std::vector<double>& channel : recording.channels)
    if (channel.size() != recording.channels[0].size())
      throw Error("recording: channels of different length: expected equal lengths");
  const Recording& idle = request.idle;
  if (!idle.channels.empty() && (idle.channels.size() != recording.channels.size() ||
                                 std::abs(idle.sample_rate / recording.sample_rate - 1.0) > SAME_RATE))
    throw Error(
        formatted("idle recording: %zu channels at %.0f Hz: expected %zu at %.0f Hz as in the recording",
                  idle.channels.size(), idle.sample_rate, recording.channels.size(), recording.sample_rate));
  const double seconds = static_cast<double>(recording.channels[0].size()) / recording.sample_rate;
  if (request.speed > 0.0) toothPassing(recording, request.teeth, request.speed);
  const SpindleSpeed speed = speedOf(recording, request);
  RecordingVerdict verdict;
  if (std::isnan(speed.value)) {
    verdict.kind = RecordingVerdict::Kind::unsure;
    verdict.speed = NAN;
    verdict.reason = "no spindle harmonics were found";
    verdict.spectrogram = pictureOf(recording);
  } else {
    const double turns = seconds * speed.value / units::TWO_PI;
    if (turns < LEAST_TURNS)
      throw Error(formatted("recording: %.3f s with %.1f revolutions: expected at least %.0f", seconds, turns,
                            LEAST_TURNS));
    const double passing = toothPassing(recording, request.teeth, speed.value);
    const int factor = static_cast<int>(std::ceil(FINE_SAMPLES * passing / recording.sample_rate));
    RecordingRequest at_speed = request;
    at_speed.speed = speed.value;
    at_speed.speed_error = SPEED_ERROR;
    std::vector<double> aliased;
    for (int k = 1; factor > 1 && k * passing < ALIASED_TO * recording.sample_rate; ++k)
      if (k * passing > 0.5 * recording.sample_rate)
        aliased.push_back(std::abs(std::remainder(k * passing, recording.sample_rate)));
    std::optional<Recording> finer;
    if (factor > 1) {
      finer = atHigherRate(recording, factor);
      at_speed.idle = atHigherRate(idle, factor);
    }
    verdict = RecordingAnalysis(finer ? *finer : recording, at_speed, speed.teeth_dominate, aliased).run();
    verdict.speed_source = speed.source;
  }
  verdict.from += recording.start;
  verdict.to += recording.start;
  for (double& time : verdict.spectrogram.time) time += recording.start;
  return verdict;
}

}  // namespace smartmill::stability
