#include "smartmill_daq/instrument/instrument.h"

#include <cmath>
#include <map>
#include <regex>
#include <set>
#include <utility>

#include "smartmill_core/error.h"
#include "smartmill_core/names.h"
#include "smartmill_core/signal/pulse_tachometer.h"

namespace smartmill::daq {
namespace {

constexpr double SHORTEST_BLOCK = 0.005, LONGEST_BLOCK = 0.02;  // [s] of SampleBlock.msg
constexpr double HIGHEST_RATE = 1e7;                            // [Hz]
constexpr double AC_STUCK =
    0.1;  // [s] a converter of 16 bit or more does not repeat a value that long with noise

const std::vector<std::string> UNITS{"N", "N m", "V", "A", "m", "m/s", "m/s2", "rad", "Pa", "1"};

/// Channels that the nodes read by name, and their units.
const std::map<std::string, std::map<std::string, std::string>>& expectedChannels() {
  static const std::map<std::string, std::map<std::string, std::string>> EXPECTED{
      {names::HAMMER, {{"hammer", "N"}}},
      {names::TACHOMETER, {{TACHOMETER_CHANNEL, "V"}}},
  };
  return EXPECTED;
}

Channel readChannel(const StrictYaml& yaml) {
  Channel channel;
  channel.input = yaml.word("input");
  channel.name = yaml.word("name");
  channel.unit = yaml.oneOf("unit", UNITS);
  channel.sensitivity = yaml.number("sensitivity");
  if (channel.sensitivity == 0.0) yaml.fail("sensitivity", "0, expected volts per " + channel.unit);
  channel.sensitivity_std = yaml.optionalNumber("sensitivity_std", Range::notNegative());
  if (yaml.has("sensitivity_date")) {
    channel.sensitivity_date = yaml.word("sensitivity_date");
    if (!std::regex_match(*channel.sensitivity_date, std::regex(R"(\d{4}-\d{2}-\d{2})")))
      yaml.fail("sensitivity_date", "'" + *channel.sensitivity_date + "', expected YYYY-MM-DD");
  }
  channel.offset = yaml.optionalNumber("offset").value_or(0.0);
  channel.range = yaml.number("range", Range::positive());
  const std::string coupling =
      yaml.has("coupling") ? yaml.oneOf("coupling", {"dc", "ac", "iepe"}) : std::string("dc");
  channel.coupling = coupling == "iepe" ? Coupling::iepe : coupling == "ac" ? Coupling::ac : Coupling::dc;
  channel.stuck = yaml.optionalNumber("stuck_time", Range::notNegative())
                      .value_or(channel.coupling == Coupling::dc ? 0.0 : AC_STUCK);
  yaml.finish();
  return channel;
}

Stream readStream(const StrictYaml& yaml) {
  Stream stream;
  stream.topic = yaml.word("topic");
  if (stream.topic.rfind("daq/", 0) != 0) yaml.fail("topic", "'" + stream.topic + "', expected daq/...");
  if (yaml.has("frame")) stream.frame = yaml.word("frame");
  std::map<std::string, std::string> units;
  for (const StrictYaml& channel : yaml.maps("channels")) {
    stream.channels.push_back(readChannel(channel));
    const Channel& last = stream.channels.back();
    if (!units.emplace(last.name, last.unit).second)
      channel.fail("name", "'" + last.name + "' is there twice");
  }
  if (stream.channels.empty()) yaml.fail("channels", "is empty");
  const auto expected = expectedChannels().find(stream.topic);
  if (expected != expectedChannels().end()) {
    for (const auto& [name, unit] : expected->second) {
      const auto found = units.find(name);
      if (found == units.end() || found->second != unit)
        yaml.fail("channels", stream.topic + " needs a channel " + name + " in " + unit);
    }
  }
  yaml.finish();
  return stream;
}

}  // namespace

std::vector<Channel> Instrument::channels() const {
  std::vector<Channel> all;
  for (const Stream& stream : streams) all.insert(all.end(), stream.channels.begin(), stream.channels.end());
  return all;
}

Instrument readInstrument(const std::string& file, std::optional<StrictYaml>* options) {
  const StrictYaml yaml = StrictYaml::fromFile(file);
  yaml.oneOf("format", {"smartmill-instrument/1"});
  Instrument instrument;
  instrument.name = yaml.word("name");
  instrument.driver = yaml.word("driver");
  *options = yaml.optionalMap("options");
  instrument.sample_rate = yaml.number("sample_rate", Range::openLow(0.0, HIGHEST_RATE));
  instrument.block =
      yaml.optionalNumber("block", Range::closed(SHORTEST_BLOCK, LONGEST_BLOCK)).value_or(instrument.block);
  if (instrument.block * instrument.sample_rate < 1.0)
    yaml.fail("block", "shorter than one sample at this sample_rate");
  if (yaml.has("clock") && yaml.oneOf("clock", {"counted", "device"}) == "device")
    instrument.clock = ClockSource::device;
  instrument.latency = yaml.optionalNumber("latency", Range::notNegative()).value_or(0.0);
  instrument.latency_std = yaml.optionalNumber("latency_std", Range::notNegative()).value_or(0.0);
  instrument.silence = yaml.optionalNumber("silence", Range::positive()).value_or(instrument.silence);
  instrument.rate_tolerance =
      yaml.optionalNumber("rate_tolerance", Range::open(0.0, 0.5)).value_or(instrument.rate_tolerance);
  std::set<std::string> topics, inputs;
  for (const StrictYaml& stream : yaml.maps("streams")) {
    instrument.streams.push_back(readStream(stream));
    if (!topics.insert(instrument.streams.back().topic).second)
      stream.fail("topic", "'" + instrument.streams.back().topic + "' is there twice");
    for (const Channel& channel : instrument.streams.back().channels) {
      if (!inputs.insert(channel.input).second)
        stream.fail("channels", "input " + channel.input + " is there twice");
    }
  }
  if (instrument.streams.empty()) yaml.fail("streams", "is empty");
  constexpr std::size_t MOST = 64;  // one bit each in the masks of a batch
  if (inputs.size() > MOST) yaml.fail("streams", "more than 64 channels");
  yaml.finish();
  return instrument;
}

Channel readChannel(const std::string& file, const std::string& topic, const std::string& name) {
  std::optional<StrictYaml> options;
  for (const Stream& stream : readInstrument(file, &options).streams) {
    if (stream.topic != topic) continue;
    for (const Channel& channel : stream.channels)
      if (channel.name == name) return channel;
  }
  throw Error(file + ": no channel " + name + " on " + topic + ", expected one of the file");
}

}  // namespace smartmill::daq
