#include "smartmill_discrepancy/live/live_gap.h"

#include <algorithm>
#include <cctype>
#include <cmath>
#include <filesystem>

#include "smartmill_core/campaign/slow_channels.h"
#include "smartmill_core/cutting/same_tool.h"
#include "smartmill_core/error.h"
#include "smartmill_core/formatted.h"
#include "smartmill_core/frames.h"
#include "smartmill_core/signal/force_channels.h"
#include "smartmill_core/signal/interpolate.h"
#include "smartmill_core/signal/statistics.h"
#include "smartmill_core/units.h"
#include "smartmill_discrepancy/data/chatter.h"
#include "smartmill_discrepancy/data/dataset.h"
#include "smartmill_sim/twin/twin.h"

namespace smartmill::discrepancy {
namespace {

struct SettlingOptions {
  double twin = 0.1;                 ///< [s] before a segment, in which the twin reaches the steady state
  double near_limit = 0.6;           ///< [s] decay time of vibrations near the stability limit
  std::size_t min_measurements = 5;  ///< of the load meter: fewer have no meaningful RMS
};

const SettlingOptions LIMITS;

// RMS difference between consecutive revolutions [N], the larger of fx and fy.
double revolutionDifference(const Record& record, const CampaignTest& test) {
  const double revolution = units::TWO_PI / test.spindle_speed * test.sample_rate;  // [samples]
  const auto whole = static_cast<std::size_t>(revolution) + 1;
  const double share = static_cast<double>(whole) - revolution;
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

void addLoad(const Spindle& spindle, const RecordSegment& segment, const Record& simulated,
             const LiveGapOptions& options, LiveGap& result) {
  const std::vector<double>& v = simulated.column("load_meter");
  const double level = mean(v), ripple = standardDeviation(v), scale = *spindle.load_meter_full_scale;
  const double half_step = 0.5 * (options.load_step * scale + spindle.load_meter_resolution);
  double squares = 0.0;
  for (const LoadMeasurement& r : segment.load) squares += std::pow(r.load * scale - level, 2);
  result.channels.push_back("load_meter");
  result.gap.push_back(std::sqrt(squares / static_cast<double>(segment.load.size()) /
                                 (half_step * half_step + ripple * ripple)));
}

// Error [N] of compensated forces, in proportion to the force, cross-talk included.
double compensationError(const Record& simulated, std::size_t from, double relative) {
  double squares = 0.0;
  for (const char* channel : FORCE_CHANNELS) {
    const std::vector<double>& force = simulated.column(channel);
    for (std::size_t i = from; i < force.size(); ++i) squares += force[i] * force[i];
  }
  return relative * std::sqrt(squares / (3.0 * static_cast<double>(simulated.size() - from)));
}

}  // namespace

MachineModel comparedModel(MachineModel model, ComparedForce compared) {
  if (compared == ComparedForce::measured) return model;
  const auto noise = model.force_sensor.noise_rms;
  model.force_sensor = ForceSensor();
  model.force_sensor.noise_rms = noise;
  model.frames.erase(frames::DYNAMOMETER);
  return model;
}

bool hasOtherTool(const RecordSegment& segment, const MachineModel& model) {
  const bool stated = segment.tool.teeth > 0 && segment.tool.diameter > 0.0;
  return segment.test.kind == TestKind::cut && stated && model.tool && !isSameTool(*model.tool, segment.tool);
}

LiveGap liveGap(const MachineModel& model, const RecordSegment& segment, const LiveGapOptions& options) {
  if (!model.force_sensor.noise_rms)
    throw Error(model.file + ": force_sensor.noise_rms_n: not found, expected for the gap");
  LiveGap result;
  result.stamp = segment.stamp;
  result.condition = segment.test.name;
  if (hasOtherTool(segment, model)) {
    result.exclusion = "is cut with another tool than that of the model";
    return result;
  }
  if (const auto chatter = findChatter(segment.record, segment.test, 0)) {
    result.exclusion = chatterText(*chatter);
    return result;
  }
  const bool with_load =
      model.spindle && model.spindle->load_meter_full_scale && segment.load.size() >= LIMITS.min_measurements;
  Record with_channels = segment.record;
  if (with_load) with_channels.add("load_meter").assign(with_channels.size(), 0.0);
  sim::SimulationOptions twin;
  twin.noise = false;
  Record simulated = sim::simulateTest(model, segment.test, with_channels, twin);
  const Axes3& noise = *model.force_sensor.noise_rms;
  if (segment.test.kind == TestKind::cut && hasToolModes(model) &&
      revolutionDifference(simulated, segment.test) > std::min(noise[0], noise[1])) {
    result.near_limit = true;
    if (segment.test.running_before.value_or(0.0) < LIMITS.near_limit) {
      result.exclusion = "is near its stability limit and not yet steady";
      return result;
    }
  }
  const std::size_t from =
      segment.test.running_before.value_or(0.0) >= LIMITS.twin ? 0 : segment.record.size() / 2;
  const double error = options.compared == ComparedForce::compensated
                           ? compensationError(simulated, from, options.force_error)
                           : 0.0;
  std::size_t axis = 0;
  for (const char* channel : FORCE_CHANNELS) {
    const auto &m = segment.record.column(channel), &s = simulated.column(channel);
    double squares = 0.0;
    for (std::size_t i = from; i < m.size(); ++i) squares += (m[i] - s[i]) * (m[i] - s[i]);
    result.channels.push_back(channel);
    result.gap.push_back(std::sqrt(squares / static_cast<double>(m.size() - from)) /
                         std::hypot(noise[axis++], error));
  }
  if (with_load) addLoad(*model.spindle, segment, simulated, options, result);
  result.model_fits =
      std::all_of(result.gap.begin(), result.gap.end(), [&](double gap) { return gap <= options.limit; });
  result.simulated = std::move(simulated);
  return result;
}

namespace {

// Load meter values on an even grid from the first to the last, since polling is not quite even.
Record resampledLoad(const RecordSegment& segment, double full_scale) {
  Record record;
  std::vector<double> load;
  const std::vector<LoadMeasurement>& read = segment.load;
  const double step = (read.back().time - read.front().time) / static_cast<double>(read.size() - 1);
  std::size_t k = 0;
  for (std::size_t i = 0; i < read.size(); ++i) {
    const double t = read.front().time + static_cast<double>(i) * step;
    while (k + 2 < read.size() && read[k + 1].time <= t) ++k;
    // The nearer of two: values are not interpolated.
    const bool later = t - read[k].time > read[k + 1].time - t;
    record.time.push_back(t);
    load.push_back(full_scale * read[later ? k + 1 : k].load);
  }
  record.add("load_meter") = std::move(load);
  return record;
}

void recordLoad(const MachineModel& model, const RecordSegment& segment, const std::string& name,
                const std::string& folder, std::vector<SlowChannel>* slow) {
  const bool has_full_scale = model.spindle && model.spindle->load_meter_full_scale;
  if (!has_full_scale || segment.load.size() < LIMITS.min_measurements) return;
  const Record load_record = resampledLoad(segment, *model.spindle->load_meter_full_scale);
  const double lasts = load_record.time.back() - load_record.time.front();
  if (!(lasts > 0.0)) return;
  SlowChannel channel{name, "load_meter", name + "_load.csv",
                      static_cast<double>(load_record.size() - 1) / lasts};
  writeCsv(load_record, folder + "/" + channel.file);
  slow->push_back(std::move(channel));
}

}  // namespace

void recordSegment(const MachineModel& model, const RecordSegment& segment, const std::string& folder) {
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
  CampaignTest test = segment.test;
  const auto is_used = [&](const std::string& name) {
    return std::any_of(campaign.tests.begin(), campaign.tests.end(),
                       [&](const CampaignTest& t) { return t.name == name; });
  };
  // A condition's name may contain characters that a file name may not.
  for (char& c : test.name) {
    if (!std::isalnum(static_cast<unsigned char>(c)) && c != '_' && c != '-') c = '_';
  }
  const std::string name = test.name;
  for (int k = 2; is_used(test.name); ++k) test.name = name + "_" + std::to_string(k);
  test.file = test.name + ".csv";
  writeCsv(segment.record, folder + "/" + test.file);
  campaign.tests.push_back(test);
  recordLoad(model, segment, test.name, folder, &slow);
  writeCampaign(campaign, slow, folder);
}

}  // namespace smartmill::discrepancy
