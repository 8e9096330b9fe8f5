#include "stability/twin_agreement.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <random>

#include "smartmill_core/error.h"

namespace smartmill::stability {
namespace {

constexpr int SAMPLES = 180;   // per revolution, rounded up to a multiple of the teeth
constexpr int WINDOW = 25;     // revolutions: longer than the beats of a quasi-periodic motion
constexpr double GONE = 1e-3;  // [1] of the scale: the initial transient has decayed; a record has six digits

}  // namespace

void AgreementOptions::validate() const {
  const auto due = [](bool good, const char* what) {
    if (!good) throw Error(std::string("agreement: ") + what);
  };
  StudyRange::validate();
  due(band >= 0.0 && band < 0.5, "expected a band of 0..50 %");
  due(feed > 0.0, "expected a feed per tooth above 0");
  due(points >= 1, "expected at least one point");
  due(revolutions >= 4 * WINDOW, "expected at least 100 revolutions");
}

bool repeatsNoMore(const Record& record, int samples, int period, double scale) {
  const int n = static_cast<int>(record.size());
  const auto change = [&](int from, int to) {  // mean square over samples [m2]
    double sum = 0.0;
    for (const char* axis : {"tool_x", "tool_y"}) {
      const std::vector<double>& u = record.column(axis);
      for (int i = std::max(from, period); i < to; ++i) {
        const auto k = static_cast<std::size_t>(i);
        sum += std::pow(u[k] - u[k - static_cast<std::size_t>(period)], 2);
      }
    }
    return sum / (to - from);
  };
  const int window = WINDOW * samples;
  const double middle = change(n / 2 - window, n / 2), last = change(n - window, n);
  if (!std::isfinite(last)) return true;
  if (last < std::pow(GONE * scale, 2)) return false;
  return last > 0.7 * middle || last > std::pow(0.05 * scale, 2);
}

std::vector<AgreementPoint> agreementWithTwin(const MachineModel& model, const RegenerativeSystem& system,
                                              const AgreementOptions& options,
                                              const std::function<void(double)>& progress) {
  options.validate();
  const auto solver = makeFloquetSolver(Method::collocation, system);
  RegenerativeSystem plain = system;
  plain.chip.reset();
  const auto places = makeFloquetSolver(Method::collocation, plain);
  std::mt19937_64 random(options.seed);
  std::uniform_real_distribution<double> unit;
  std::vector<AgreementPoint> points;
  std::vector<TwinCut> cuts;
  const int samples = wholeTeeth(SAMPLES, system.teeth);
  // Ends the search if no speed has a limit.
  for (int tries = 0; static_cast<int>(points.size()) < options.points; ++tries) {
    if (tries > 100 * options.points + 1000) throw Error("agreement: no points outside the band found");
    AgreementPoint p;
    p.speed = options.speed_low + (options.speed_high - options.speed_low) * unit(random);
    const Limit limit = places->limit(p.speed, options.max_depth);
    const double share = 0.4 + 1.2 * unit(random);
    p.limit = limit.depth;
    p.depth = (std::isfinite(limit.depth) ? limit.depth : 0.5 * options.max_depth) * share;
    const auto at = solver->at(p.speed);
    const CharacteristicMultiplier m = at->multiplier(p.depth);
    p.radius = m.radius();
    p.kind = m.kind();
    // Outside the band: the stability is the same at the depth plus and minus the band.
    bool alike = true;
    for (const double side : {1.0 - options.band, 1.0 + options.band})
      alike = alike && (at->multiplier(side * p.depth).radius() > 1.0) == p.chatters();
    if (!alike) continue;
    points.push_back(p);
    cuts.push_back(
        {p.speed, {system.entry, system.exit, p.depth, options.feed}, samples, options.revolutions, 0});
  }
  const int period = system.evenPitch() ? samples / system.teeth : samples;
  runTwinCuts(
      {model}, cuts, {{"tool_x", "tool_y"}},
      [&](std::size_t i, const Record& record) {
        points[i].observed_chatter = repeatsNoMore(record, samples, period, options.feed);
      },
      progress);
  return points;
}

}  // namespace smartmill::stability
