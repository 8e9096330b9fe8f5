#include "smartmill_discrepancy/data/dataset.h"

#include <algorithm>
#include <cmath>
#include <set>

#include "smartmill_core/campaign/record_columns.h"
#include "smartmill_core/campaign/slow_channels.h"
#include "smartmill_core/campaign/stream_offset.h"
#include "smartmill_core/error.h"
#include "smartmill_core/formatted.h"
#include "smartmill_core/signal/fourier.h"
#include "smartmill_core/signal/statistics.h"
#include "smartmill_core/units.h"
#include "smartmill_discrepancy/data/alignment.h"
#include "smartmill_discrepancy/data/stream_shift.h"
#include "smartmill_sim/twin/axis_motion.h"
#include "smartmill_sim/twin/tip_trajectory.h"

namespace smartmill::discrepancy {
namespace {

const std::vector<std::string> COMPARED{"fx", "fy", "fz", "load_meter", "tool_x", "tool_y"};
struct RecordOptions {
  std::size_t min_samples = 64;  ///< of a record, for a periodogram
  std::size_t min_quiet = 50;    ///< samples without force for a noise estimate to 10 %
  std::size_t clipped_run = 5;   ///< equal extreme samples in a row of a noisy channel
  double contact = 0.05;         ///< [1] of the peak of a hit: contact has begun
  double contact_lead = 1e-3;    ///< [s] that the contact starts earlier at most
  /// [1] RMS over that between lines, from which lines without cutting (hum, unbalance) are not noise.
  double max_line_ratio = 1.5;
  double slow_piece = 0.25;        ///< [s] of a mean of a slow channel
  double short_revolutions = 6.0;  ///< of a shortened cut: the entry and some of the steady cut
  double max_short_share = 0.75;   ///< [1] of the samples of fitted cuts that are kept: no benefit above
};

const RecordOptions LIMITS;

bool cutsOrTaps(const CampaignTest& test) {
  return test.kind == TestKind::cut || test.kind == TestKind::tap;
}

std::size_t quietSamples(const CampaignTest& test, const Record& record) {
  if (!cutsOrTaps(test)) return record.size();
  if (test.kind == TestKind::tap) {
    const std::vector<double>& hammer = record.column("hammer");
    double peak = 0.0;
    for (const double f : hammer) peak = std::max(peak, std::abs(f));
    std::size_t i = 0;
    while (i < hammer.size() && std::abs(hammer[i]) < LIMITS.contact * peak) ++i;
    const auto lead = static_cast<std::size_t>(std::lround(LIMITS.contact_lead * test.sample_rate));
    return i > lead ? i - lead : 0;
  }
  if (!test.engage_time) return 0;
  std::size_t i = 0;
  while (i < record.size() && record.time[i] < *test.engage_time - 0.5 / test.sample_rate) ++i;
  return i;
}

std::string number(double value) {
  return formatted("%.6g", value);
}

// A noisy channel repeats its extreme value only if it is clipped; a dead channel has one value.
void checkChannel(const TestData& data, const std::string& channel) {
  const std::vector<double>& values = data.record.column(channel);
  const auto [low, high] = std::minmax_element(values.begin(), values.end());
  if (*low == *high)
    throw Error(data.record.file + ": " + channel + " is dead: every sample is " + number(*low));
  if (channel == "load_meter") return;  // rounded and slow: values repeat
  if (const std::size_t run = longestRunAtExtreme(values); run >= LIMITS.clipped_run) {
    throw Error(data.record.file + ": " + channel + " is clipped: " + std::to_string(run) +
                " equal samples in a row at its extreme (range " + number(*low) + " to " + number(*high) +
                ")");
  }
}

struct Pool {
  double squares = 0.0;
  std::size_t freedom = 0;
};

std::map<std::string, double> noiseOf(const Dataset& data) {
  std::map<std::string, Pool> quiet;
  std::map<std::string, std::vector<double>> between_lines;
  for (const TestData& t : data.tests) {
    for (const std::string& channel : t.channels) {
      const std::vector<double>& values = t.record.column(channel);
      if (t.quiet >= LIMITS.min_quiet && cutsOrTaps(t.test)) {
        const std::vector<double> part(values.begin(), values.begin() + static_cast<std::ptrdiff_t>(t.quiet));
        const double deviation =
            part.size() >= LIMITS.min_samples && channel != "load_meter"
                ? std::min(standardDeviation(part), LIMITS.max_line_ratio * noiseBetweenLines(part))
                : standardDeviation(part);
        quiet[channel].squares += deviation * deviation * static_cast<double>(t.quiet - 1);
        quiet[channel].freedom += t.quiet - 1;
      } else {
        between_lines[channel].push_back(noiseBetweenLines(values));
      }
      quiet[channel];
    }
  }
  std::map<std::string, double> noise;
  for (const auto& [channel, pool] : quiet) {
    double& value = noise[channel];
    if (data.nominal.force_sensor.noise_rms) {
      for (std::size_t axis = 0; axis < 3; ++axis) {
        if (channel == COMPARED[axis]) value = (*data.nominal.force_sensor.noise_rms)[axis];
      }
    }
    if (value == 0.0 && pool.freedom >= LIMITS.min_quiet)
      value = std::sqrt(pool.squares / static_cast<double>(pool.freedom));
    if (value == 0.0 && !between_lines[channel].empty()) value = median(between_lines[channel]);
    if (!(value > 0.0)) {
      throw Error(data.campaign.folder + ": no noise estimate for " + channel +
                  ": expected noise_rms_n in the model, or records without force");
    }
  }
  return noise;
}

// @param measurements on the record's clock @param begin, lasts [s] start and length of the record
SlowMeans meansOf(const std::string& channel, const Record& measurements, double begin, double lasts) {
  const std::vector<double>& values = measurements.column(channel);
  const auto pieces = std::max<std::size_t>(1, static_cast<std::size_t>(lasts / LIMITS.slow_piece));
  SlowMeans slow;
  slow.channel = channel;
  std::vector<std::vector<double>> of_piece(pieces), times(pieces);
  for (std::size_t i = 0; i < values.size(); ++i) {
    const double t = measurements.time[i] - begin;
    if (t < 0.0 || t > lasts) continue;
    const auto k = std::min(pieces - 1, static_cast<std::size_t>(t / lasts * static_cast<double>(pieces)));
    of_piece[k].push_back(values[i]);
    times[k].push_back(t);
  }
  double variance = 0.0;
  for (std::size_t k = 0; k < pieces; ++k) {
    if (of_piece[k].empty()) continue;
    slow.mean.push_back(mean(of_piece[k]));
    slow.times.push_back(times[k]);
    const double deviation = standardDeviation(of_piece[k]);
    variance += deviation * deviation / static_cast<double>(of_piece[k].size());
  }
  if (slow.mean.empty()) throw Error(measurements.file + ": no sample within the record of its test");
  slow.scatter = std::sqrt(variance / static_cast<double>(slow.mean.size()));
  std::vector<double> sorted = values;
  std::sort(sorted.begin(), sorted.end());
  for (std::size_t i = 1; i < sorted.size(); ++i) {
    const double step = sorted[i] - sorted[i - 1];
    if (step > 1e-9 * std::abs(sorted[i]) && (slow.step == 0.0 || step < slow.step)) slow.step = step;
  }
  return slow;
}

void addSlowChannels(Dataset& data) {
  for (const SlowChannel& channel : readSlowChannels(data.campaign)) {
    const auto test = std::find_if(data.tests.begin(), data.tests.end(),
                                   [&](const TestData& t) { return t.test.name == channel.test; });
    if (!data.nominal.spindle) {
      const std::string note = channel.channel + " is not compared: the model has no spindle section";
      if (std::count(data.notes.begin(), data.notes.end(), note) == 0) data.notes.push_back(note);
      continue;
    }
    if (test->record.has(channel.channel))
      throw Error(test->record.file + ": " + channel.channel +
                  " is in slow_channels too; expected one of both");
    const Record measurements = readRecord(data.campaign, channel);
    test->slow.push_back(meansOf(channel.channel, measurements, test->record.time.front(),
                                 static_cast<double>(test->record.size()) / test->test.sample_rate));
  }
}

// Noise of a mean: scatter of its samples, which ripple in a cut, and the common rounding error; the
// resolution is at most the smallest difference between samples.
void addSlowNoise(Dataset& data) {
  std::map<std::string, double> step, least;
  for (const TestData& t : data.tests) {
    for (const SlowMeans& slow : t.slow) {
      double& resolution = step[slow.channel];
      if (slow.step > 0.0 && (resolution == 0.0 || slow.step < resolution)) resolution = slow.step;
    }
  }
  for (TestData& t : data.tests) {
    for (SlowMeans& slow : t.slow) {
      const double resolution = std::max(step[slow.channel], data.nominal.spindle->load_meter_resolution);
      slow.noise = std::hypot(slow.scatter, resolution / std::sqrt(12.0));
      double& noise = least[slow.channel];
      if (noise == 0.0 || slow.noise < noise) noise = slow.noise;
    }
  }
  data.noise.insert(least.begin(), least.end());
}

// No free simulation follows the phase of chatter: such cuts are compared by one-step prediction or excluded.
void markChatter(Dataset& data) {
  for (std::size_t k = 0; k < data.tests.size();) {
    TestData& t = data.tests[k];
    const auto chatter = findChatter(t.record, t.test, t.first_cut);
    if (!chatter) {
      ++k;
      continue;
    }
    const std::string note =
        "test " + t.test.name + " chatters at " + number(std::round(chatter->frequency)) + " Hz and is ";
    // The phase of a chattering cut without spindle angle cannot be estimated.
    if (canBeGuided(t, data.nominal) && !t.phase_estimated) {
      data.notes.push_back(note + "compared by one-step prediction");
      t.chatter = chatter;
      t.guided = true;
      ++k;
      continue;
    }
    data.notes.push_back(note + "not compared sample by sample");
    data.chattering.push_back({std::move(t), *chatter});
    data.tests.erase(data.tests.begin() + static_cast<std::ptrdiff_t>(k));
  }
  if (std::all_of(data.tests.begin(), data.tests.end(), [](const TestData& t) { return t.chatter; }))
    throw Error(data.campaign.folder + ": every test chatters; expected a test without chatter");
}

// The records of a campaign. Where an axis moves and the force columns are recorded later or earlier than the
// controller's, the tests state it afterwards.
std::vector<RecordedTest> recordedTests(const Campaign& campaign, std::vector<std::string>* shifts) {
  constexpr double BEYOND_CHANCE = 3.0;  // standard deviations
  std::vector<RecordedTest> tests;
  for (const CampaignTest& test : campaign.tests) tests.push_back({test, readRecord(campaign, test)});
  const std::optional<ForceShift> shift = shiftOfForces(tests);
  if (!shift || std::abs(shift->delay) < BEYOND_CHANCE * shift->std_dev) return tests;
  for (RecordedTest& one : tests) {
    if (one.test.stream_offset.empty() && sim::AxisMotion::isRecorded(one.record))
      one.test.stream_offset["force"] = shift->delay;
  }
  shifts->push_back(
      formatted("forces are recorded %.5f +- %.2g s %s than the controller's columns: with that shift the "
                "acceleration of axis %c explains %.1f %% of f%c",
                std::abs(shift->delay), shift->std_dev, shift->delay > 0.0 ? "later" : "earlier", shift->axis,
                100.0 * shift->explained, shift->axis));
  return tests;
}

}  // namespace

bool hasToolModes(const MachineModel& model) {
  return !model.tool_tip.x.modes.empty() || !model.tool_tip.y.modes.empty();
}

bool canBeGuided(const TestData& test, const MachineModel& model) {
  return hasToolModes(model) && model.workpiece_modes.empty() && test.test.kind == TestKind::cut &&
         !test.test.running_before && sim::TipTrajectory::isAvailable(test.record) &&
         !sim::TipTrajectory::isFromForce(test.record);
}

std::size_t Dataset::samples() const {
  std::size_t sum = 0;
  for (const TestData& t : tests) {
    sum += t.channels.size() * t.record.size();
    for (const SlowMeans& slow : t.slow) sum += slow.mean.size();
  }
  return sum;
}

double noiseBetweenLines(const std::vector<double>& values) {
  if (values.size() < LIMITS.min_samples) {
    throw Error("noise estimate: " + std::to_string(values.size()) + " samples, expected at least " +
                std::to_string(LIMITS.min_samples));
  }
  // Second differences remove slow trends before the leakage of the window spreads them.
  const std::size_t n = values.size() - 2;
  std::vector<double> x(n);
  double window_power = 0.0;
  for (std::size_t i = 0; i < n; ++i) {
    const double s = std::sin(3.14159265358979 * (static_cast<double>(i) + 0.5) / static_cast<double>(n));
    x[i] = (values[i] - 2.0 * values[i + 1] + values[i + 2]) * s * s;
    window_power += s * s * s * s;
  }
  const auto spectrum = fourier(x);
  std::vector<double> power;
  for (std::size_t k = spectrum.size() / 2; k + 1 < spectrum.size(); ++k) {
    const double w = 3.14159265358979 * static_cast<double>(k) / static_cast<double>(spectrum.size() - 1);
    const double gain = 2.0 - 2.0 * std::cos(w);  // of the second difference
    power.push_back(std::norm(spectrum[k]) / (gain * gain));
  }
  // Median of an exponential distribution: mean times ln 2.
  return std::sqrt(median(power) / std::log(2.0) / window_power);
}

std::optional<Dataset> shortenedDataset(const Dataset& data) {
  Dataset shortened = data;
  double all = 0.0, kept = 0.0;
  for (TestData& t : shortened.tests) {
    if (t.test.kind != TestKind::cut || t.heldout) continue;
    const double revolution = units::TWO_PI / t.test.spindle_speed * t.test.sample_rate;  // [samples]
    const std::size_t first = std::max(
        LIMITS.min_samples, t.first_cut + static_cast<std::size_t>(LIMITS.short_revolutions * revolution));
    const std::size_t size = t.phase_estimated ? t.record.size() : first;
    all += static_cast<double>(t.record.size());
    kept += static_cast<double>(std::min(size, t.record.size()));
    if (size >= t.record.size()) continue;
    t.record.time.resize(size);
    for (std::vector<double>& column : t.record.columns) column.resize(size);
  }
  if (kept >= LIMITS.max_short_share * all) return {};
  return shortened;
}

void chooseHeldout(std::vector<TestData>& tests) {
  std::vector<TestData*> cuts, air;
  for (TestData& t : tests) {
    t.heldout = false;
    if (t.test.kind == TestKind::cut && !t.chatter) cuts.push_back(&t);
    if (t.test.kind == TestKind::air) air.push_back(&t);
  }
  // Conditions of a cut. A test alone at the end of a range is not held out.
  const auto conditions = [](const TestData& t) {
    return std::vector<double>{t.test.spindle_speed,
                               t.test.engagement->feed_per_tooth,
                               t.test.engagement->axial_depth,
                               t.test.engagement->entry,
                               t.test.engagement->exit,
                               t.test.feed_direction,
                               t.test.cut_time_before.value_or(0.0)};
  };
  std::vector<TestData*> inside;
  for (TestData* t : cuts) {
    bool alone = false;
    const std::vector<double> mine = conditions(*t);
    for (std::size_t c = 0; c < mine.size(); ++c) {
      bool above = false, below = false, equal = false, differ = false;
      for (const TestData* other : cuts) {
        if (other == t) continue;
        const double theirs = conditions(*other)[c];
        const double near = 1e-6 * std::max(std::abs(theirs), std::abs(mine[c]));
        if (std::abs(theirs - mine[c]) <= near) {
          equal = true;
        } else {
          differ = true;
          (theirs > mine[c] ? above : below) = true;
        }
      }
      alone = alone || (differ && !equal && !(above && below));
    }
    if (!alone) inside.push_back(t);
  }
  const std::size_t count = cuts.size() >= 4 ? std::min(inside.size(), (cuts.size() + 3) / 4) : 0;
  for (std::size_t k = 0; k < count; ++k) inside[(2 * k + 1) * inside.size() / (2 * count)]->heldout = true;
  if (air.size() >= 4) {
    std::sort(air.begin(), air.end(), [](const TestData* a, const TestData* b) {
      return a->test.spindle_speed < b->test.spindle_speed;
    });
    air[air.size() / 2]->heldout = true;
  }
}

Dataset loadDataset(const Campaign& campaign, const MachineModel& nominal) {
  Dataset data;
  data.campaign = campaign;
  data.nominal = nominal;
  std::set<std::string> notes;
  for (RecordedTest& recorded : recordedTests(campaign, &data.stream_shifts)) {
    const CampaignTest& test = recorded.test;
    TestData t;
    t.test = test;
    t.record = aligned(recorded.record, test);
    if (t.record.size() < LIMITS.min_samples) {
      throw Error(t.record.file + ": " + std::to_string(t.record.size()) + " samples, expected at least " +
                  std::to_string(LIMITS.min_samples));
    }
    for (const std::string& name : t.record.names) {
      if (std::find(COMPARED.begin(), COMPARED.end(), name) != COMPARED.end()) {
        if (name == "load_meter" && (!nominal.spindle || test.kind == TestKind::tap)) {
          notes.insert(test.kind == TestKind::tap
                           ? "load_meter of taps is not compared"
                           : "load_meter is not compared: the model has no spindle section");
          continue;
        }
        t.channels.push_back(name);
        checkChannel(t, name);
      } else if (name != "spindle_angle" && name != "hammer" && !motionAxis(name)) {
        notes.insert(name + " is not simulated");
      }
    }
    if (t.channels.empty()) throw Error(t.record.file + ": no channel to compare");
    t.phase_estimated =
        test.kind != TestKind::tap && test.spindle_speed > 0.0 && !t.record.has("spindle_angle");
    t.quiet = quietSamples(test, t.record);
    t.first_cut = test.kind == TestKind::cut ? t.quiet : t.record.size();
    for (const std::string& note : t.record.notes) notes.insert(note);
    data.tests.push_back(std::move(t));
  }
  if (data.tests.empty()) throw Error(campaign.folder + ": no tests");
  data.notes.assign(notes.begin(), notes.end());
  addSlowChannels(data);
  data.noise = noiseOf(data);
  addSlowNoise(data);
  for (const std::string& note : estimatePhases(data)) data.notes.push_back(note);
  markChatter(data);
  chooseHeldout(data.tests);
  return data;
}

}  // namespace smartmill::discrepancy
