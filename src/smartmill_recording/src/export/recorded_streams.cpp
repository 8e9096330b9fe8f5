#include <algorithm>
#include <cmath>
#include <map>
#include <memory>
#include <set>
#include <utility>

#include "smartmill_core/campaign/record.h"
#include "smartmill_core/campaign/record_columns.h"
#include "smartmill_core/error.h"
#include "smartmill_core/formatted.h"
#include "smartmill_core/names.h"
#include "smartmill_recording/export/exported_stream.h"
#include "smartmill_recording/import/channel_file.h"
#include "smartmill_recording/recording_reader.h"

namespace smartmill::recording {
namespace {

/// Collects the samples of one topic.
class StreamBuilder {
 public:
  explicit StreamBuilder(const std::string& name) { stream_.name = name; }

  /// @param columns name and unit, without time; the same for every sample of the stream
  void setColumns(const std::vector<std::pair<std::string, std::string>>& columns, double sample_rate) {
    if (!stream_.columns.empty()) {
      if (columns.size() + 1 != stream_.columns.size())
        throw Error(stream_.name + formatted(": %zu channels after %zu, expected as many", columns.size(),
                                             stream_.columns.size() - 1));
      return;
    }
    stream_.sample_rate = sample_rate;
    stream_.columns.push_back({"time", "s", {}});
    for (const auto& [name, unit] : columns) stream_.columns.push_back({name, unit, {}});
  }
  /// @param stamp [s] since 1970
  void addTime(double stamp) { stream_.columns[0].values.push_back(stamp); }
  void add(std::size_t column, double value) { stream_.columns[column + 1].values.push_back(value); }

  ExportedStream take() { return std::move(stream_); }

 private:
  ExportedStream stream_;
};

using Builder = std::shared_ptr<StreamBuilder>;

void add(StreamBuilder& to, const SampleBlock& block) {
  std::vector<std::pair<std::string, std::string>> columns;
  for (std::size_t c = 0; c < block.channels.size(); ++c)
    columns.emplace_back(block.channels[c], block.units[c]);
  to.setColumns(columns, block.sample_rate);
  for (std::size_t i = 0; i < block.size(); ++i) {
    to.addTime(block.timeOf(i));
    for (std::size_t c = 0; c < columns.size(); ++c) to.add(c, block.at(i, c));
  }
}

void add(StreamBuilder& to, const ForceBlock& block) {
  to.setColumns({{"fx", "N"}, {"fy", "N"}, {"fz", "N"}, {"status", "1"}}, block.sample_rate);
  for (std::size_t i = 0; i < block.force[0].size(); ++i) {
    to.addTime(block.stamp + static_cast<double>(i) / block.sample_rate);
    for (std::size_t axis = 0; axis < 3; ++axis) to.add(axis, block.force[axis][i]);
    to.add(3, static_cast<double>(block.status));
  }
}

void add(StreamBuilder& to, const SpindleAngle& angle) {
  to.setColumns({{"angle", "rad"}, {"speed", "rad/s"}}, 0.0);
  to.addTime(angle.stamp);
  to.add(0, angle.angle);
  to.add(1, angle.speed);
}

void add(StreamBuilder& to, const LoadSample& load) {
  std::vector<std::pair<std::string, std::string>> columns{{"spindle_load", "1"}, {"spindle_speed", "rad/s"}};
  for (const std::string& axis : load.axes) columns.emplace_back("load_" + axis, "1");
  to.setColumns(columns, 0.0);
  to.addTime(load.stamp);
  to.add(0, load.spindle_load);
  to.add(1, load.spindle_speed);
  for (std::size_t a = 0; a < load.axes.size(); ++a) to.add(2 + a, load.axis_load[a]);
}

void add(StreamBuilder& to, const CncState& state) {
  if (state.axes.empty()) return;  // before the first connection
  std::vector<std::pair<std::string, std::string>> columns{{"spindle_speed", "rad/s"}, {"feed", "m/s"}};
  for (const std::string& axis : state.axes) columns.emplace_back("position_" + axis, "m");
  to.setColumns(columns, 0.0);
  to.addTime(state.stamp);
  to.add(0, state.spindle_speed);
  to.add(1, state.feed);
  for (std::size_t a = 0; a < state.axes.size(); ++a) to.add(2 + a, state.position[a]);
}

template <class Data>
bool holds(const RecordedConnection& connection) {
  return connection.type == Recorded<Data>::type() && connection.md5sum == Recorded<Data>::md5();
}

template <class... Data>
struct Sampled {
  static bool holdsAny(const RecordedConnection& connection) { return (holds<Data>(connection) || ...); }
  static void follow(RecordingReader& reader, const RecordedConnection& connection, const Builder& builder) {
    (followOne<Data>(reader, connection, builder), ...);
  }

 private:
  template <class One>
  static void followOne(RecordingReader& reader, const RecordedConnection& connection,
                        const Builder& builder) {
    if (!holds<One>(connection)) return;
    reader.on<One>(connection.topic, [builder](const One& data, double) { add(*builder, data); });
  }
};
using Exported = Sampled<SampleBlock, ForceBlock, SpindleAngle, LoadSample, CncState>;

std::string listOf(const std::set<std::string>& names) {
  std::string text;
  for (const std::string& name : names) text += (text.empty() ? "" : ", ") + name;
  return text;
}

void checkSelected(const std::string& file, const ExportSelection& selection,
                   const std::set<std::string>& present, const char* what) {
  for (const std::string& name : selection.names) {
    if (present.count(name) == 0)
      throw Error(file + ": " + what + " '" + name + "': expected one of " + listOf(present));
  }
}

bool isSelected(const ExportSelection& selection, const std::string& name) {
  return selection.names.empty() ||
         std::find(selection.names.begin(), selection.names.end(), name) != selection.names.end();
}

/// Times [s] since `start`; samples outside the selection are left out.
void trim(ExportedStream& stream, double start, const ExportSelection& selection) {
  std::vector<double>& time = stream.columns[0].values;
  std::vector<std::size_t> kept;
  for (std::size_t i = 0; i < time.size(); ++i) {
    time[i] -= start;
    if (time[i] >= selection.from && time[i] <= selection.to) kept.push_back(i);
  }
  if (kept.size() == time.size()) return;
  for (ExportedColumn& column : stream.columns) {
    for (std::size_t k = 0; k < kept.size(); ++k) column.values[k] = column.values[kept[k]];
    column.values.resize(kept.size());
  }
}

std::vector<ExportedStream> notEmpty(std::vector<ExportedStream> streams, const std::string& file) {
  streams.erase(std::remove_if(streams.begin(), streams.end(),
                               [](const ExportedStream& stream) { return stream.size() == 0; }),
                streams.end());
  if (streams.empty()) throw Error(file + ": no samples in the selection, expected one or more");
  double values = 0.0;
  for (const ExportedStream& stream : streams)
    values += static_cast<double>(stream.size()) * static_cast<double>(stream.columns.size());
  if (values > MOST_VALUES) {
    throw Error(file + formatted(": %.3g values, expected at most %.3g: select topics or times", values,
                                 MOST_VALUES));
  }
  return streams;
}

/// Unit of a column that a Record holds in SI.
std::string siUnit(const std::string& name) {
  const RecordColumn* column = recordColumn(name);
  if (!column) return "";
  const std::string unit = column->unit;
  if (unit == "um" || unit == "mm") return "m";
  return unit == "mm/min" ? "m/s" : unit;
}

}  // namespace

std::vector<ExportedStream> streamsOfRecording(const std::string& file, const ExportSelection& selection,
                                               const std::function<void(double)>& progress) {
  const std::string prefix = names::absolute("");
  const auto opened = openRecording(file);
  RecordingReader reader(file);
  std::set<std::string> sampled;
  std::vector<Builder> builders;
  for (const auto& [id, connection] : opened->connections()) {
    const bool ours = connection.topic.rfind(prefix, 0) == 0;
    const std::string name = ours ? connection.topic.substr(prefix.size()) : connection.topic;
    if (!Exported::holdsAny(connection) || !sampled.insert(name).second || !isSelected(selection, name))
      continue;
    builders.push_back(std::make_shared<StreamBuilder>(name));
    Exported::follow(reader, connection, builders.back());
  }
  checkSelected(file, selection, sampled, "topic");
  reader.run(progress);
  std::vector<ExportedStream> streams;
  double start = std::numeric_limits<double>::infinity();
  for (const Builder& builder : builders) {
    streams.push_back(builder->take());
    if (streams.back().size() > 0) start = std::min(start, streams.back().columns[0].values.front());
  }
  for (ExportedStream& stream : streams) {
    stream.start = start;
    if (stream.size() > 0) trim(stream, start, selection);
  }
  return notEmpty(std::move(streams), file);
}

std::vector<ExportedStream> streamsOfCampaign(const std::string& folder, const ExportSelection& selection) {
  const Campaign campaign = readCampaignWithPaths(folder);
  std::set<std::string> present;
  for (const CampaignTest& test : campaign.tests) present.insert(test.name);
  checkSelected(folder, selection, present, "test");
  std::vector<ExportedStream> streams;
  for (const CampaignTest& test : campaign.tests) {
    if (!isSelected(selection, test.name)) continue;
    const Record record = readRecord(campaign, test);
    ExportedStream stream;
    stream.name = test.name;
    stream.sample_rate = test.sample_rate;
    stream.columns.push_back({"time", "s", record.time});
    for (std::size_t c = 0; c < record.names.size(); ++c)
      stream.columns.push_back({record.names[c], siUnit(record.names[c]), record.columns[c]});
    trim(stream, 0.0, selection);
    streams.push_back(std::move(stream));
  }
  return notEmpty(std::move(streams), folder);
}

}  // namespace smartmill::recording
