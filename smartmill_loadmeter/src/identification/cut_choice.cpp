#include "smartmill_loadmeter/identification/cut_choice.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <set>

#include "smartmill_core/formatted.h"
#include "smartmill_core/units.h"
#include "smartmill_loadmeter/identification/production.h"
#include "smartmill_loadmeter/identification/torque_sensitivity.h"

namespace smartmill::loadmeter {

namespace {

using Indices = std::vector<std::size_t>;

/// Chooses cuts one by one, then drops and exchanges cuts where this saves time.
class Chooser {
 public:
  Chooser(const CutInformation& known, const std::vector<CandidateCut>& candidates,
          const LoadMeterReadings& readings, const Spindle& spindle, const ChoiceGoal& goal)
      : known_(known), candidates_(candidates), readings_(readings), spindle_(spindle), goal_(goal) {}

  CutChoice choose() {
    CutChoice choice;
    for (std::size_t i = 0; i < candidates_.size(); ++i) {
      const std::string reason = beyondLimit(candidates_[i]);
      if (reason.empty()) {
        allowed_.push_back(i);
      } else {
        choice.excluded.push_back(candidates_[i].condition.name + ": " + reason);
      }
    }
    while (!isEnough(chosen_) && addBest()) {
    }
    choice.reached = isEnough(chosen_);
    if (choice.reached) shorten();
    sortByGain();
    describe(&choice);
    return choice;
  }

 private:
  std::string beyondLimit(const CandidateCut& cut) const {
    const CuttingCondition& c = cut.condition;
    const double depth = c.engagement.axial_depth, limit = (1.0 - goal_.depth_margin) * cut.depth_limit;
    if (cut.depth_limit > 0.0 && depth > limit)
      return formatted("%.2f mm deep, expected at most %.2f mm, %.0f %% of the stability limit",
                       depth / units::MM, limit / units::MM, 100.0 * (1.0 - goal_.depth_margin));
    const double torque =
        torqueSensitivity(c.tool, c.engagement).torque(goal_.highest.ktc, goal_.highest.kte);
    if (goal_.torque > 0.0 && torque > goal_.torque)
      return formatted("torque up to %.2f N m, limit %.2f N m", torque, goal_.torque);
    const double power = torque * c.spindle_speed;
    if (goal_.power > 0.0 && power > goal_.power)
      return formatted("power up to %.0f W, limit %.0f W", power, goal_.power);
    return "";
  }

  CutInformation with(CutInformation information, std::size_t i) const {
    const CuttingCondition& cut = candidates_[i].condition;
    information.addTest(cut, spindle_, readings_.voltageStd(steadyTime(cut) - readings_.settling));
    return information;
  }

  CutInformation informationOf(const Indices& cuts) const {
    CutInformation information = known_;
    for (const std::size_t i : cuts) information = with(information, i);
    return information;
  }

  std::size_t missingFeeds(const Indices& cuts) const {
    std::set<double> feeds(goal_.feeds_made.begin(), goal_.feeds_made.end());
    for (const std::size_t i : cuts) feeds.insert(candidates_[i].condition.engagement.feed_per_tooth);
    return goal_.least_feeds > feeds.size() ? goal_.least_feeds - feeds.size() : 0;
  }

  double stockOf(const Indices& cuts) const {
    double width = 0.0;
    for (const std::size_t i : cuts) width += candidates_[i].stock;
    return width;
  }

  bool isPrecise(const Indices& cuts) const {
    const TorqueCovariance c = informationOf(cuts).covariance().torque();
    return std::sqrt(c.tc) <= goal_.ktc_std && std::sqrt(c.te) <= goal_.kte_std;
  }

  bool isEnough(const Indices& cuts) const { return missingFeeds(cuts) == 0 && isPrecise(cuts); }

  // Whether the stock suffices for the cuts and for the feeds that are still missing then.
  bool fits(const Indices& cuts) const {
    double narrowest = std::numeric_limits<double>::infinity();
    for (const CandidateCut& cut : candidates_) narrowest = std::min(narrowest, cut.stock);
    const double missing = static_cast<double>(missingFeeds(cuts));
    return stockOf(cuts) + missing * narrowest <= goal_.stock * (1.0 + 1e-9);
  }

  // Information gain [nat] of a further cut.
  double gainOf(const CutInformation& now, std::size_t i) const {
    return now.entropy() - with(now, i).entropy();
  }

  bool isChosen(std::size_t i) const { return std::find(chosen_.begin(), chosen_.end(), i) != chosen_.end(); }

  // Of these cuts the one with the largest gain per second [1/s] above a least one.
  std::optional<std::size_t> mostInformative(const CutInformation& now, const Indices& cuts,
                                             double least) const {
    std::optional<std::size_t> pick;
    for (const std::size_t i : cuts) {
      const double rate = gainOf(now, i) / candidates_[i].cutting_time;
      if (rate > least) least = rate, pick = i;
    }
    return pick;
  }

  // The most informative cut per second; with the precision reached, of those with another feed.
  bool addBest() {
    const CutInformation now = informationOf(chosen_);
    const bool for_feeds = isPrecise(chosen_);
    Indices open;
    for (const std::size_t i : allowed_) {
      if (isChosen(i)) continue;
      Indices more = chosen_;
      more.push_back(i);
      if (fits(more) && !(for_feeds && missingFeeds(more) == missingFeeds(chosen_))) open.push_back(i);
    }
    const std::optional<std::size_t> pick = mostInformative(now, open, 0.0);
    if (pick) chosen_.push_back(*pick);
    return pick.has_value();
  }

  double timeOf(const Indices& cuts) const {
    double time = 0.0;
    for (const std::size_t i : cuts) time += candidates_[i].cutting_time;
    return time;
  }

  // Drops one or two cuts, or exchanges them for another one, as long as this saves time.
  void shorten() {
    for (Indices shortest = chosen_;; chosen_ = shortest) {
      for (std::size_t first = 0; first < chosen_.size(); ++first) {
        for (std::size_t second = first; second < chosen_.size(); ++second) {
          Indices rest;
          for (std::size_t at = 0; at < chosen_.size(); ++at) {
            if (at != first && at != second) rest.push_back(chosen_[at]);
          }
          keepShorter(rest, &shortest);
          for (const std::size_t other : allowed_) {
            if (isChosen(other)) continue;
            Indices exchanged = rest;
            exchanged.push_back(other);
            keepShorter(exchanged, &shortest);
          }
        }
      }
      if (!(timeOf(shortest) < timeOf(chosen_))) return;
    }
  }

  void keepShorter(const Indices& cuts, Indices* shortest) const {
    if (timeOf(cuts) < timeOf(*shortest) && fits(cuts) && isEnough(cuts)) *shortest = cuts;
  }

  // In the order of the gain per second.
  void sortByGain() {
    const Indices cuts = chosen_;
    chosen_.clear();
    while (chosen_.size() < cuts.size()) {
      Indices open;
      for (const std::size_t i : cuts) {
        if (!isChosen(i)) open.push_back(i);
      }
      const double any = -std::numeric_limits<double>::infinity();
      chosen_.push_back(mostInformative(informationOf(chosen_), open, any).value_or(open.front()));
    }
  }

  void describe(CutChoice* choice) const {
    CutInformation information = known_;
    for (const std::size_t i : chosen_) {
      const CutInformation after = with(information, i);
      const TorqueCovariance c = after.covariance().torque();
      const double gain = information.entropy() - after.entropy();
      choice->cuts.push_back({i, gain, gain / candidates_[i].cutting_time, std::sqrt(c.tc), std::sqrt(c.te)});
      information = after;
    }
  }

  const CutInformation& known_;
  const std::vector<CandidateCut>& candidates_;
  const LoadMeterReadings& readings_;
  const Spindle& spindle_;
  const ChoiceGoal& goal_;
  Indices allowed_, chosen_;
};

}  // namespace

double LoadMeterReadings::voltageStd(double time) const {
  const double n = std::max(2.0, std::floor(time / period));
  return std::hypot(noise / std::sqrt(n), rounding);
}

LoadMeterReadings readingsOf(const std::vector<LoadTest>& air_cuts, const Spindle& spindle, double settling) {
  LoadMeterReadings readings;
  readings.settling = settling;
  readings.noise = readings.rounding = spindle.load_meter_resolution / std::sqrt(12.0);
  double variance = 0.0, duration = 0.0, intervals = 0.0, tests = 0.0;
  double shown = std::numeric_limits<double>::infinity();  // [V] smallest step within an air cut
  for (const LoadTest& test : air_cuts) {
    if (test.voltages.size() < 2) continue;
    variance += test.variance();
    duration += test.duration;
    intervals += static_cast<double>(test.voltages.size() - 1);
    tests += 1.0;
    const double step = resolutionOf(test.voltages, 0.0);
    if (step > 0.0) shown = std::min(shown, step);  // 0: all readings are the same
  }
  if (!(duration > 0.0)) return readings;
  readings.period = duration / intervals;
  readings.air_time = duration / tests;
  variance /= tests;
  // As in meanVoltage(): noise of some 0.4 steps spreads the readings over the steps of the meter.
  const double resolution =
      std::isfinite(shown) ? std::max(shown, spindle.load_meter_resolution) : spindle.load_meter_resolution;
  const double step = resolution / std::sqrt(12.0), noise2 = std::max(0.0, variance - step * step);
  readings.rounding = resolution > 0.0
                          ? step * std::exp(-2.0 * units::PI * units::PI * noise2 / (resolution * resolution))
                          : 0.0;
  double of_means = 0.0;  // noise that passes the lag of the meter is correlated
  for (const LoadTest& test : air_cuts) {
    if (test.voltages.size() < 2) continue;
    const double own = std::pow(test.voltage.std_dev, 2) - std::pow(readings.rounding, 2);
    of_means += static_cast<double>(test.voltages.size()) * own / tests;
  }
  readings.noise = std::sqrt(std::max(variance, of_means));
  return readings;
}

double steadyTime(const CuttingCondition& cut) {
  double length2 = 0.0;
  for (std::size_t a = 0; a < 3; ++a) length2 += std::pow(cut.steady_to[a] - cut.steady_from[a], 2);
  const double feed =
      cut.engagement.feed_per_tooth * cut.tool.teeth * cut.spindle_speed / units::TWO_PI;  // [m/s]
  return feed > 0.0 ? std::sqrt(length2) / feed : 0.0;
}

TorqueCovariance withoutKnowledge() {
  const RecursiveCoefficients::Start start;
  return {start.ktc_std * start.ktc_std, 0.0, start.kte_std * start.kte_std};
}

CutChoice chooseCuts(const CutInformation& known, const std::vector<CandidateCut>& candidates,
                     const LoadMeterReadings& readings, const Spindle& spindle, const ChoiceGoal& goal) {
  return Chooser(known, candidates, readings, spindle, goal).choose();
}

}  // namespace smartmill::loadmeter
