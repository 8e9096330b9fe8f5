#include "commands/recording_file.h"

#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <optional>

#include "smartmill_core/error.h"
#include "smartmill_core/formatted.h"
#include "smartmill_core/io/csv.h"
#include "smartmill_core/io/sound_file.h"
#include "smartmill_core/names.h"
#include "smartmill_recording/recording_file.h"
#include "smartmill_recording/recording_reader.h"

namespace smartmill::stability {
namespace {

Recording fromSound(const RecordingOptions& o) {
  SoundFile sound = readSoundFile(o.file);
  Recording recording;
  recording.sample_rate = sound.sample_rate;
  if (o.channels.empty()) {
    recording.channels = std::move(sound.channels);
    return recording;
  }
  for (const std::string& channel : o.channels) {
    std::size_t number = 0;
    char rest = 0;
    if (std::sscanf(channel.c_str(), "%zu%c", &number, &rest) != 1 || number < 1 ||
        number > sound.channels.size())
      throw Error(o.file + ": channel '" + channel + "': expected a number from 1 to " +
                  std::to_string(sound.channels.size()));
    recording.channels.push_back(sound.channels[number - 1]);
  }
  return recording;
}

bool isTime(const std::string& name) {
  return name == "t" || name == "t[s]" || name == "time" || name == "time[s]";
}

Recording fromTable(const RecordingOptions& o) {
  const NumberTable table = readNumberTable(o.file);
  const auto time = std::find_if(table.names.begin(), table.names.end(), isTime);
  if (time == table.names.end()) throw Error(o.file + ": expected a column time[s] (or t[s])");
  const std::vector<double>& t = table.columns[static_cast<std::size_t>(time - table.names.begin())];
  if (t.size() < 2 || !(t.back() > t.front()))
    throw Error(o.file + ": column " + *time + ": expected increasing values");
  Recording recording;
  recording.sample_rate = static_cast<double>(t.size() - 1) / (t.back() - t.front());
  for (std::size_t i = 1; i < t.size(); ++i) {
    if (!std::isfinite(t[i]))
      throw Error(o.file + ": column " + *time + formatted(": expected a number after %.6f s", t[i - 1]));
    if (std::abs((t[i] - t[i - 1]) * recording.sample_rate - 1.0) > 0.1)
      throw Error(o.file + formatted(": samples at %.6f s: expected equal spacing", t[i]));
  }
  std::vector<std::string> names = o.channels;
  for (const std::string& name : table.names)
    if (o.channels.empty() && !isTime(name) && name.rfind("spindle_angle", 0) != 0) names.push_back(name);
  for (const std::string& name : names) {
    recording.channels.push_back(table.column(name));
    for (std::size_t i = 0; i < t.size(); ++i)
      if (!std::isfinite(recording.channels.back()[i]))
        throw Error(o.file + ": column " + name + formatted(": expected a number at %.6f s", t[i]));
  }
  return recording;
}

/// Finds the longest segment of a topic without lost samples.
class LongestSegment {
 public:
  explicit LongestSegment(const RecordingOptions& o) : o_(o) {}
  void add(const SampleBlock& block) {
    if (!start_) start_ = block.stamp;
    if (block.stamp - *start_ < o_.from || block.stamp - *start_ > o_.to) return;
    if (block.first_index != next_ || current_.channels.size() != block.channels.size()) restart(block);
    next_ = block.first_index + block.size();
    for (std::size_t c = 0; c < block.channels.size(); ++c)
      for (std::size_t i = 0; i < block.size(); ++i) current_.channels[c].push_back(block.at(i, c));
  }
  Recording result() {
    finishSegment();
    longest_.same_unit = true;
    if (longest_.channels.empty()) throw Error(o_.file + ": topic " + o_.topic + ": expected samples");
    for (const std::vector<double>& channel : longest_.channels)
      for (const double v : channel)
        if (!std::isfinite(v)) throw Error(o_.file + ": topic " + o_.topic + ": expected finite values");
    return longest_;
  }

 private:
  void finishSegment() {
    if (!current_.channels.empty() &&
        (longest_.channels.empty() || current_.channels[0].size() > longest_.channels[0].size()))
      longest_ = current_;
  }
  void restart(const SampleBlock& block) {
    finishSegment();
    current_ = Recording();
    current_.start = block.stamp - *start_;
    current_.sample_rate = block.sample_rate;
    current_.channels.resize(block.channels.size());
  }

  const RecordingOptions& o_;
  std::optional<double> start_;  // [s] of the topic
  std::uint64_t next_ = 0;
  Recording current_, longest_;
};

Recording fromBag(RecordingOptions o) {
  RecordingReader bag(o.file);
  for (const char* topic : {names::SOUND, "daq/vibration", names::FORCE_COMPENSATED, names::DYNAMOMETER})
    if (o.topic.empty() && bag.has(topic)) o.topic = topic;
  if (o.topic.empty() || !bag.has(o.topic))
    throw Error(o.file + ": expected topic " +
                (o.topic.empty() ? "daq/sound, daq/vibration or force/compensated" : o.topic));
  LongestSegment segment(o);
  if (o.topic.find("force/") != std::string::npos) {
    bag.on<ForceBlock>(o.topic, [&](const ForceBlock& force, double) {
      SampleBlock block;
      block.stamp = force.stamp;
      block.sample_rate = force.sample_rate;
      block.first_index = force.first_index;
      block.channels = {"fx", "fy", "fz"};
      for (std::size_t i = 0; i < force.force[0].size(); ++i)
        for (const std::vector<double>& axis : force.force) block.samples.push_back(axis[i]);
      segment.add(block);
    });
  } else {
    bag.on<SampleBlock>(o.topic, [&](const SampleBlock& block, double) { segment.add(block); });
  }
  bag.run();
  return segment.result();
}

}  // namespace

Recording loadRecording(const RecordingOptions& o) {
  if (isRecording(o.file)) return fromBag(o);
  Recording recording = isSoundFile(o.file) ? fromSound(o) : fromTable(o);
  const auto size = recording.channels.empty() ? 0 : recording.channels[0].size();
  const auto at = [&](double seconds) {
    return static_cast<std::size_t>(
        std::clamp(seconds * recording.sample_rate, 0.0, static_cast<double>(size)));
  };
  const std::size_t from = at(o.from), to = at(o.to);
  if (from >= to)
    throw Error(o.file + formatted(": no samples from %.2f to %.2f s (--from, --to): expected at least one",
                                   o.from, o.to));
  recording.start = static_cast<double>(from) / recording.sample_rate;
  for (std::vector<double>& channel : recording.channels)
    channel = {channel.begin() + static_cast<std::ptrdiff_t>(from),
               channel.begin() + static_cast<std::ptrdiff_t>(to)};
  return recording;
}

RecordingVerdict judgeFile(const RecordingOptions& o, const RecordingRequest& request) {
  const Recording recording = loadRecording(o);
  try {
    return judgeRecording(recording, request);
  } catch (const Error& error) {
    throw Error(o.file + ": " + error.what());
  }
}

}  // namespace smartmill::stability
