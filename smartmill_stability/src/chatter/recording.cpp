#include "smartmill_stability/chatter/recording.h"

#include <algorithm>
#include <cmath>
#include <map>

#include "chatter/cut_finder.h"
#include "smartmill_core/error.h"
#include "smartmill_core/formatted.h"
#include "smartmill_core/signal/chatter_criterion.h"
#include "smartmill_core/signal/statistics.h"
#include "smartmill_core/units.h"
#include "smartmill_stability/chatter/chatter_advice.h"

namespace smartmill::stability {
namespace {

using Reason = ChatterEvidence::Reason;

/// [1] Relative variation of the spindle speed within a window, and error of its correction.
constexpr double SPEED_ERROR = 6e-4;

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

/// Applies ChatterCriterion to windows of whole revolutions of the cut.
class RecordingAnalysis {
 public:
  RecordingAnalysis(const Recording& recording, const RecordingRequest& request)
      : recording_(recording),
        cut_(recording, request),
        criterion_(optionsOf(request)),
        teeth_(request.teeth),
        period_(units::TWO_PI / cut_.speed()),
        revolution_(period_ * recording.sample_rate),
        turns_(static_cast<std::size_t>(cut_.window() / period_)) {
    for (const std::vector<double>& channel : recording_.channels) {
      const double deviation = standardDeviation(channel);
      if (!(deviation > 0.0)) continue;
      channels_.push_back(channel);
      for (double& value : channels_.back()) value /= deviation;
    }
  }

  RecordingVerdict run() {
    const std::vector<double> background = this->background();
    for (const double start : startsWithin(true)) add(criterion_.judge(windowAt(start), period_, background));
    return verdict();
  }

 private:
  static ChatterCriterionOptions optionsOf(const RecordingRequest& request) {
    const CutFinderOptions band;
    ChatterCriterionOptions options;
    options.lowest_frequency = band.lowest;
    options.highest_frequency = band.highest;
    options.speed_error = SPEED_ERROR;
    options.modes = request.modes;
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

  RevolutionWindow windowAt(double start) const {
    RevolutionWindow window(static_cast<std::size_t>(std::ceil(revolution_)), turns_, teeth_);
    for (const std::vector<double>& channel : channels_) window.add(channel, start, revolution_);
    return window;
  }

  /// Mean power of each line outside the cut; empty without such windows.
  std::vector<double> background() const {
    std::vector<double> sum;
    if (!cut_.hasAir()) return sum;
    const std::vector<double> starts = startsWithin(false);
    for (const double start : starts) {
      const RevolutionWindow window = windowAt(start);
      sum.resize(window.power().size(), 0.0);
      for (std::size_t k = 0; k < sum.size(); ++k)
        sum[k] += window.power()[k] / static_cast<double>(starts.size());
    }
    return sum;
  }

  void add(const ChatterEvidence& evidence) {
    ++windows_;
    ++reasons_[evidence.reason];
    synchronous_ += evidence.synchronous;
    if (!evidence.chatter) return;
    // Consecutive windows agree on the frequency or on another line of the family, which excludes a run-up of
    // the spindle.
    bool steady = chattering_.empty();
    if (!steady) {
      const double before = chattering_.back().order;
      steady = std::abs(evidence.order - before) < SAME_CHATTER * before ||
               std::abs(std::remainder(evidence.order - before, 1.0)) < 1.0 / static_cast<double>(turns_);
    }
    steady_ += steady;
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
    verdict.speed = cut_.speed();
    verdict.from = cut_.from();
    verdict.to = cut_.to();
    verdict.spectrogram = cut_.spectrogram();
    verdict.chatter = windows_ > 0 && 2 * steady_ >= windows_;
    verdict.cut = cut_.hasAir() || verdict.chatter || cut_.hasToothPassing();
    if (!verdict.cut) verdict.reason = "no louder part and no lines at the tooth passing frequency";
    if (!verdict.chatter) {
      if (verdict.cut) verdict.reason = textOf(mostFrequentReason());
      return verdict;
    }
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
    return verdict;
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
  double period_, revolution_;  // [s], [samples]
  std::size_t turns_;
  std::vector<std::vector<double>> channels_;  // with unit variance
  std::size_t windows_ = 0, steady_ = 0;
  std::map<Reason, std::size_t> reasons_;
  double synchronous_ = 0.0;
  std::vector<ChatterEvidence> chattering_;
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
  RecordingVerdict verdict = RecordingAnalysis(recording, request).run();
  verdict.from += recording.start;
  verdict.to += recording.start;
  for (double& time : verdict.spectrogram.time) time += recording.start;
  return verdict;
}

}  // namespace smartmill::stability
