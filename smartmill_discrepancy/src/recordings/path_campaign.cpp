#include "smartmill_discrepancy/recordings/path_campaign.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include "node/monitor_parameters.h"
#include "smartmill_core/axis_names.h"
#include "smartmill_core/campaign/record.h"
#include "smartmill_core/campaign/slow_channels.h"
#include "smartmill_core/campaign/stream_offset.h"
#include "smartmill_core/error.h"
#include "smartmill_core/formatted.h"
#include "smartmill_core/io/text_file.h"
#include "smartmill_core/math/running_line.h"
#include "smartmill_core/signal/derivative.h"
#include "smartmill_core/signal/force_channels.h"
#include "smartmill_core/units.h"
#include "smartmill_discrepancy/live/segment_campaign.h"
#include "smartmill_program/live/path_follower.h"
#include "smartmill_program/nc/linuxcnc_program.h"
#include "smartmill_program/nc/program_reader.h"

namespace smartmill::discrepancy {
namespace {

namespace fs = std::filesystem;

constexpr double PERIOD = 0.02;          // [s] between two states, as the bridge reads them
constexpr double FEED_SMOOTHING = 0.08;  // [s] standard deviation of the weights
constexpr double RESOLUTION = 1.0e-4;    // [m] of the stock

std::shared_ptr<const program::LiveProgram> programOf(const Campaign& campaign, const CampaignTest& test,
                                                      const std::string& model_file) {
  std::vector<std::string> files;
  for (const auto& [number, file] : test.program->tools)
    files.push_back(std::to_string(number) + "=" + campaign.inFolder(file));
  if (files.empty()) files.push_back(model_file);
  program::ToolModels tools(files);
  program::ReaderOptions reader;
  reader.tool_radius = [&tools](int tool) { return tools.radius(tool); };
  const std::string name = campaign.inFolder(test.program->file);
  std::vector<program::Move> moves = test.program->linuxcnc
                                         ? program::interpretWithLinuxcnc(readText(name), name, reader)
                                         : program::readProgram(name, reader);
  for (const program::Move& move : moves) tools.of(move.tool);
  const Workpiece workpiece = readMachineModel(model_file).needWorkpiece("follow the program of a path");
  program::Stock stock(program::stockBlock(workpiece, test.program->zero), RESOLUTION);
  program::SimulationOptions simulation;
  simulation.rapid = tools.rapid();
  return std::make_shared<const program::LiveProgram>(program::prepareProgram(
      name, std::move(moves), tools, stock, simulation, program::StretchParameters()));
}

/// What controller, spindle and dynamometer would have delivered during a record.
class RecordStreams {
 public:
  RecordStreams(const Record& record, double sample_rate)
      : record_(record),
        rate_(sample_rate),
        block_(static_cast<std::size_t>(std::max(1.0, std::round(PERIOD * sample_rate)))) {
    std::array<std::vector<double>, 3> velocity;
    for (std::size_t a = 0; a < 3; ++a) {
      const std::vector<double>& column = record.column(std::string("axis_") + AXIS_NAMES[a]);
      for (std::size_t i = 0; i < column.size(); i += block_) position_[a].push_back(column[i]);
      velocity[a] =
          smoothedDerivative(position_[a], sample_rate / static_cast<double>(block_), 1, FEED_SMOOTHING);
    }
    for (std::size_t k = 0; k < velocity[0].size(); ++k)
      feed_.push_back(std::hypot(velocity[0][k], velocity[1][k], velocity[2][k]));
    const std::vector<double>& angle = record.column("spindle_angle");
    turned_.reserve(angle.size());
    for (std::size_t i = 0; i < angle.size(); ++i)
      turned_.push_back(i == 0 ? angle[0]
                               : turned_[i - 1] + std::remainder(angle[i] - angle[i - 1], units::TWO_PI));
  }

  std::size_t size() const { return feed_.size(); }
  double end() const { return record_.time.back(); }  ///< [s]
  /// [m/s] Least-squares slope of the way over the time between two stamps, which late positions change less
  /// than the feed at one of them; 0 with fewer than three positions.
  double meanFeed(double from, double to) const {
    RunningLine line;  // [m] over [s]
    double way = 0.0;
    for (std::size_t k = 1; k < size(); ++k) {
      if (stamp(k) < from || stamp(k) >= to) continue;
      if (line.count() > 0)
        way += std::hypot(position_[0][k] - position_[0][k - 1], position_[1][k] - position_[1][k - 1],
                          position_[2][k] - position_[2][k - 1]);
      line.add(stamp(k), way);
    }
    return line.count() < 3 || !line.isDetermined() ? 0.0 : line.slope();
  }
  CncState state(std::size_t k) const {
    CncState state;
    state.stamp = stamp(k);
    state.connected = state.motion = true;
    state.run = CncRun::start;
    state.axes = {"X", "Y", "Z"};
    for (const std::vector<double>& axis : position_) state.position.push_back(axis[k]);
    state.spindle_speed = speed(k);
    state.feed = feed_[k];
    return state;
  }
  SpindleAngle angle(std::size_t k) const {
    return {stamp(k), record_.column("spindle_angle")[k * block_], speed(k)};
  }
  SampleBlock forces(std::size_t k) const {
    SampleBlock block;
    block.stamp = stamp(k);
    block.sample_rate = rate_;
    block.first_index = k * block_;
    block.channels = {FORCE_CHANNELS.begin(), FORCE_CHANNELS.end()};
    block.units.assign(FORCE_CHANNELS.size(), "N");
    const std::size_t end = std::min((k + 1) * block_, record_.size());
    for (std::size_t i = k * block_; i < end; ++i)
      for (const char* channel : FORCE_CHANNELS) block.samples.push_back(record_.column(channel)[i]);
    return block;
  }

 private:
  double stamp(std::size_t k) const { return record_.time[k * block_]; }
  double speed(std::size_t k) const {
    const std::size_t from = k * block_, to = std::min(from + block_, record_.size() - 1);
    return to == from ? 0.0 : (turned_[to] - turned_[from]) / (record_.time[to] - record_.time[from]);
  }

  const Record& record_;
  double rate_;        // [Hz]
  std::size_t block_;  // [samples]
  std::array<std::vector<double>, 3> position_;
  std::vector<double> feed_;    // [m/s]
  std::vector<double> turned_;  // [rad] spindle angle without jumps
};

/// The load meter of a test, by the record or by a channel of its own rate; none where the model states no
/// full scale.
std::vector<LoadSample> loadsOf(const Campaign& campaign, const CampaignTest& test, const Record& record,
                                const MachineModel& model,
                                const std::function<void(const std::string&)>& progress) {
  std::optional<Record> measured;
  if (record.has("load_meter")) measured = record;
  for (const SlowChannel& slow : readSlowChannels(campaign))
    if (slow.test == test.name) measured = readRecord(campaign, slow);
  if (!measured) return {};
  const double full_scale = model.spindle ? model.spindle->load_meter_full_scale.value_or(0.0) : 0.0;
  if (full_scale == 0.0) {
    progress(measured->file + ": load_meter is not used, the model states no load_meter_full_scale_v");
    return {};
  }
  std::vector<LoadSample> loads;
  const std::vector<double>& volts = measured->column("load_meter");
  for (std::size_t i = 0; i < volts.size(); ++i) {
    if (!loads.empty() && measured->time[i] < loads.back().stamp + PERIOD) continue;
    loads.push_back({measured->time[i], volts[i] / full_scale, 0.0, {}, {}});
  }
  return loads;
}

void addPath(const Campaign& campaign, const CampaignTest& test, const MachineModel& model,
             SegmentCampaign* cuts, const std::function<void(const std::string&)>& progress) {
  const auto program = programOf(campaign, test, model.file);
  const Record record = aligned(readRecord(campaign, test), test);
  const std::vector<LoadSample> loads = loadsOf(campaign, test, record, model, progress);
  auto load = loads.begin();
  const RecordStreams streams(record, test.sample_rate);
  const MonitorParameters parameters;
  const program::FollowerParameters follower_parameters;
  program::PathFollower follower(program, test.program->zero,
                                 {"tool", model.workpiece ? model.workpiece->material : ""},
                                 follower_parameters);
  SegmentPipeline segments(
      parameters.segment, ComparedForce::measured, parameters.hold_back, [&](RecordSegment segment) {
        segment.test.name = test.name + " " + segment.test.name;
        segment.test.start_time = segment.test.start_time.value_or(0.0) + test.start_time.value_or(0.0);
        if (segment.test.cut_time_before) *segment.test.cut_time_before += test.cut_time_before.value_or(0.0);
        cuts->add(segment);
      });
  std::size_t followed = 0, steady_cuts = 0;
  std::vector<CuttingCondition> conditions;
  for (std::size_t k = 0; k < streams.size(); ++k) {
    if (const auto condition = follower.handle(streams.state(k))) {
      steady_cuts += condition->kind == CuttingCondition::Kind::cut;
      conditions.push_back(*condition);
    }
    followed += follower.status().follows == program::PathFollower::Follows::following;
  }
  auto condition = conditions.begin();
  for (std::size_t k = 0; k < streams.size(); ++k) {
    const CncState state = streams.state(k);
    for (; condition != conditions.end() && condition->stamp <= state.stamp; ++condition) {
      if (condition->kind == CuttingCondition::Kind::cut) {
        const double end = condition + 1 == conditions.end() ? streams.end() : (condition + 1)->stamp;
        if (const double feed = streams.meanFeed(condition->stamp, end); feed > 0.0)
          condition->engagement.feed_per_tooth =
              feed * units::TWO_PI / (condition->spindle_speed * condition->tool.teeth);
      }
      segments.push(*condition);
    }
    segments.push(state);
    segments.push(streams.angle(k));
    segments.push(streams.forces(k));
    for (; load != loads.end() && load->stamp <= state.stamp; ++load) segments.push(*load);
  }
  segments.flush();
  const double share = static_cast<double>(followed) / static_cast<double>(streams.size());
  if (steady_cuts == 0)
    throw Error(record.file +
                formatted(": no steady cut; the positions are on the path of %s in %.0f %% of the "
                          "record, expected a distance below %.3g mm (program_zero_mm)",
                          test.program->file.c_str(), 100.0 * share,
                          follower_parameters.path_tolerance / units::MM));
  progress(formatted("%s: %zu steady cuts along %s, on its path within %.3f mm in %.0f %% of the record",
                     test.name.c_str(), steady_cuts, test.program->file.c_str(),
                     follower.status().largest_deviation / units::MM, 100.0 * share));
}

/// Copies the records of the other tests and adds these to the campaign of the cuts.
void addOtherTests(const Campaign& from, const std::string& folder) {
  Campaign to = readCampaign(folder);
  std::vector<SlowChannel> slow = readSlowChannels(to);
  const std::vector<SlowChannel> others = readSlowChannels(from);
  const auto copy = [&](const std::string& file) {
    fs::create_directories(fs::path(to.inFolder(file)).parent_path());
    fs::copy_file(from.inFolder(file), to.inFolder(file));
  };
  for (const CampaignTest& test : from.tests) {
    if (test.kind == TestKind::path) continue;
    copy(test.file);
    to.tests.push_back(test);
    for (const SlowChannel& channel : others) {
      if (channel.test != test.name) continue;
      copy(channel.file);
      slow.push_back(channel);
    }
  }
  writeCampaign(to, slow, folder);
}

}  // namespace

Campaign campaignOfPaths(const Campaign& campaign, const std::string& model_file, const std::string& folder,
                         const std::function<void(const std::string&)>& progress) {
  const MachineModel model = readMachineModel(model_file);
  SegmentCampaign cuts;
  for (const CampaignTest& test : campaign.tests) {
    if (test.kind == TestKind::path) addPath(campaign, test, model, &cuts, progress);
  }
  if (cuts.write(model, MonitorParameters().gapOptions(), folder, progress) == 0)
    throw Error(campaign.folder +
                ": expected a path with a steady cut of 0.3 s that is not near the stability "
                "limit of the model");
  try {
    addOtherTests(campaign, folder);
  } catch (const fs::filesystem_error& error) {
    throw Error(error.path1().string() + ": cannot be copied: " + error.code().message());
  }
  return readCampaign(folder);
}

}  // namespace smartmill::discrepancy
