#include "smartmill_discrepancy/live/live_gap.h"

#include <algorithm>
#include <cctype>
#include <cmath>
#include <filesystem>

#include "smartmill_core/campaign/slow_channels.h"
#include "smartmill_core/error.h"
#include "smartmill_core/formatted.h"
#include "smartmill_core/signal/interpolate.h"
#include "smartmill_core/signal/statistics.h"
#include "smartmill_core/units.h"
#include "smartmill_discrepancy/data/chatter.h"
#include "smartmill_sim/twin/twin.h"

namespace smartmill::discrepancy {
namespace {

constexpr double LEAST_RUNNING = 0.1;      // [s] before a stretch, within which the twin settles
constexpr double EDGE_SETTLING = 0.6;      // [s] that vibrations near the stability limit take to die out
constexpr std::size_t LEAST_READINGS = 5;  // of the load meter

// RMS difference from one revolution to the next [N], the larger of fx and fy.
double unsettled(const Record& record, const CampaignTest& test) {
  const double turn = units::TWO_PI / test.spindle_speed * test.sample_rate;  // [samples]
  const auto whole = static_cast<std::size_t>(turn) + 1;
  const double share = static_cast<double>(whole) - turn;
  double largest = 0.0;
  for (const char* channel : {"fx", "fy"}) {
    const std::vector<double>& x = record.column(channel);
    double squares = 0.0, count = 0.0;
    for (std::size_t i = whole + 1; i < x.size(); ++i) {
      const double before =
          catmullRom(x[i - whole - 1], x[i - whole], x[i - whole + 1], x[i - whole + 2], share);
      squares += (x[i] - before) * (x[i] - before);
      count += 1.0;
    }
    if (count > 0.0) largest = std::max(largest, std::sqrt(squares / count));
  }
  return largest;
}

std::string chatterText(const Chatter& chatter) {
  return formatted("chatters at %.0f Hz with %.0f N", chatter.frequency, chatter.amplitude);
}

void addLoad(const Spindle& spindle, const Stretch& stretch, const Record& simulated,
             const LiveGapOptions& options, LiveGap& result) {
  const std::vector<double>& v = simulated.column("load_meter");
  const double level = mean(v), ripple = standardDeviation(v), scale = *spindle.load_meter_full_scale;
  const double half_step = 0.5 * (options.load_step * scale + spindle.load_meter_resolution);
  double squares = 0.0;
  for (const LoadReading& r : stretch.load) squares += std::pow(r.load * scale - level, 2);
  result.channels.push_back("load_meter");
  result.gap.push_back(std::sqrt(squares / static_cast<double>(stretch.load.size()) /
                                 (half_step * half_step + ripple * ripple)));
}

}  // namespace

LiveGap liveGap(const MachineModel& model, const Stretch& stretch, const LiveGapOptions& options) {
  if (!model.force_sensor.noise_rms)
    throw Error(model.file + ": force_sensor.noise_rms_n is missing (needed to measure a gap)");
  LiveGap result;
  result.stamp = stretch.stamp;
  result.condition = stretch.test.name;
  if (const auto chatter = findChatter(stretch.record, stretch.test, 0)) {
    result.aside = chatterText(*chatter);
    return result;
  }
  const bool with_load =
      model.spindle && model.spindle->load_meter_full_scale && stretch.load.size() >= LEAST_READINGS;
  Record shown = stretch.record;
  if (with_load) shown.add("load_meter").assign(shown.size(), 0.0);
  sim::SimulationOptions twin;
  twin.noise = false;
  Record simulated = sim::simulateTest(model, stretch.test, shown, twin);
  const Axes3& noise = *model.force_sensor.noise_rms;
  const bool vibrates = !model.tool_tip.x.modes.empty() || !model.tool_tip.y.modes.empty();
  if (stretch.test.kind == TestKind::cut && vibrates &&
      unsettled(simulated, stretch.test) > std::min(noise[0], noise[1])) {
    // A tool that is about to chatter.
    result.at_the_edge = true;
    if (stretch.test.running_before.value_or(0.0) < EDGE_SETTLING) {
      result.aside = "is near its stability limit and has not settled yet";
      return result;
    }
  }
  const std::size_t from =
      stretch.test.running_before.value_or(0.0) >= LEAST_RUNNING ? 0 : stretch.record.size() / 2;
  std::size_t axis = 0;
  for (const char* channel : {"fx", "fy", "fz"}) {
    const auto &m = stretch.record.column(channel), &s = simulated.column(channel);
    double squares = 0.0;
    for (std::size_t i = from; i < m.size(); ++i) squares += (m[i] - s[i]) * (m[i] - s[i]);
    result.channels.push_back(channel);
    result.gap.push_back(std::sqrt(squares / static_cast<double>(m.size() - from)) / noise[axis++]);
  }
  if (with_load) addLoad(*model.spindle, stretch, simulated, options, result);
  result.model_fits =
      std::all_of(result.gap.begin(), result.gap.end(), [&](double gap) { return gap <= options.limit; });
  result.simulated = std::move(simulated);
  return result;
}

namespace {

// The readings of a stretch on an even grid from the first to the last of them: polling is not quite even.
Record readingsOf(const Stretch& stretch, double full_scale) {
  Record record;
  std::vector<double> load;
  const std::vector<LoadReading>& read = stretch.load;
  const double step = (read.back().time - read.front().time) / static_cast<double>(read.size() - 1);
  std::size_t k = 0;
  for (std::size_t i = 0; i < read.size(); ++i) {
    const double t = read.front().time + static_cast<double>(i) * step;
    while (k + 2 < read.size() && read[k + 1].time <= t) ++k;
    // The nearer of two: what was told is not mixed.
    const bool later = t - read[k].time > read[k + 1].time - t;
    record.time.push_back(t);
    load.push_back(full_scale * read[later ? k + 1 : k].load);
  }
  record.add("load_meter") = std::move(load);
  return record;
}

void recordLoad(const MachineModel& model, const Stretch& stretch, const std::string& name,
                const std::string& folder, std::vector<SlowChannel>* slow) {
  const bool told = model.spindle && model.spindle->load_meter_full_scale;
  if (!told || stretch.load.size() < LEAST_READINGS) return;
  const Record readings = readingsOf(stretch, *model.spindle->load_meter_full_scale);
  const double lasts = readings.time.back() - readings.time.front();
  if (!(lasts > 0.0)) return;
  SlowChannel channel{name, "load_meter", name + "_load.csv",
                      static_cast<double>(readings.size() - 1) / lasts};
  writeCsv(readings, folder + "/" + channel.file);
  slow->push_back(std::move(channel));
}

}  // namespace

void recordStretch(const MachineModel& model, const Stretch& stretch, const std::string& folder) {
  std::error_code failed;
  std::filesystem::create_directories(folder, failed);
  if (failed) throw Error(folder + ": " + failed.message());
  Campaign campaign;
  std::vector<SlowChannel> slow;
  if (std::filesystem::exists(folder + "/campaign.yaml")) {
    campaign = readCampaign(folder);
    slow = readSlowChannels(campaign);
  } else {
    campaign.model_file = "model.yaml";
    writeMachineModel(model, folder + "/model.yaml");
  }
  campaign.folder = folder;
  CampaignTest test = stretch.test;
  const auto taken = [&](const std::string& name) {
    return std::any_of(campaign.tests.begin(), campaign.tests.end(),
                       [&](const CampaignTest& t) { return t.name == name; });
  };
  // A name may hold what no file's name may.
  for (char& c : test.name) {
    if (!std::isalnum(static_cast<unsigned char>(c)) && c != '_' && c != '-') c = '_';
  }
  const std::string name = test.name;
  for (int k = 2; taken(test.name); ++k) test.name = name + "_" + std::to_string(k);
  test.file = test.name + ".csv";
  writeCsv(stretch.record, folder + "/" + test.file);
  campaign.tests.push_back(test);
  recordLoad(model, stretch, test.name, folder, &slow);
  writeCampaign(campaign, slow, folder);
}

}  // namespace smartmill::discrepancy
