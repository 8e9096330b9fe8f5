#include "smartmill_recording/account.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <list>
#include <map>
#include <optional>
#include <sstream>
#include <utility>

#include "smartmill_core/error.h"
#include "smartmill_core/names.h"
#include "smartmill_recording/recorded.h"
#include "smartmill_recording/recording_file.h"

namespace smartmill {
namespace {

constexpr std::size_t HEADER_SIZE = 12;  // [bytes] sequence number, seconds, nanoseconds

// Whether messages begin with a std_msgs/Header.
bool beginsWithHeader(const std::string& definition) {
  std::istringstream lines(definition);
  for (std::string line; std::getline(lines, line);) {
    std::istringstream words(line.substr(0, line.find('#')));
    std::string type;
    if (words >> type) return type == "Header" || type == "std_msgs/Header";
  }
  return false;
}

struct Header {
  std::uint32_t sequence = 0;
  double stamp = 0.0;  // [s]
};

Header headerOf(const std::uint8_t* data) {
  std::uint32_t words[3];
  std::memcpy(words, data, HEADER_SIZE);  // little-endian, as the machines that ROS 1 runs on
  return {words[0], words[1] + 1e-9 * words[2]};
}

// A block of samples, whatever its message.
struct Block {
  std::string topic;
  double stamp = 0.0, rate = 0.0;  // [s], [Hz]
  std::uint64_t first = 0, count = 0, not_finite = 0;
};

std::uint64_t notFinite(const std::vector<double>& values) {
  return static_cast<std::uint64_t>(
      std::count_if(values.begin(), values.end(), [](double v) { return !std::isfinite(v); }));
}

// Inputs of the nodes. A node counts from its start, so that the last message of each start counts.
class NodeAccounts {
 public:
  void add(const std::uint8_t* data, std::size_t size) {
    const plain::NodeHealth& health = health_.decode(data, size);
    last_[{health.node, health.started}] = health;
  }

  std::vector<InputAccount> inputs() const {
    std::map<std::pair<std::string, std::string>, InputAccount> sums;
    for (const auto& [start, health] : last_) {
      for (const plain::StreamHealth& input : health.inputs) {
        InputAccount& sum = sums[{health.node, input.topic}];
        sum.node = health.node;
        sum.topic = input.topic;
        sum.starts = std::max(sum.starts, health.starts);
        sum.received += input.received;
        sum.dropped += input.dropped;
        sum.refused += input.refused;
        sum.lost += input.lost;
      }
    }
    std::vector<InputAccount> inputs;
    for (const auto& [key, sum] : sums) inputs.push_back(sum);
    return inputs;
  }

 private:
  Recorded<plain::NodeHealth> health_;
  std::map<std::pair<std::string, double>, plain::NodeHealth> last_;  // by node and start
};

// Account of one connection.
class Stream {
 public:
  /// @param nodes which gets the messages on health
  Stream(const RecordedConnection& connection, std::vector<StreamGap>* gaps, NodeAccounts* nodes)
      : has_header_(beginsWithHeader(connection.definition)), gaps_(gaps) {
    account_.topic = connection.topic;
    const auto publisher = connection.more.find("callerid");
    if (publisher != connection.more.end()) account_.publisher = publisher->second;
    const std::string& type = connection.type;
    if (type == Recorded<SampleBlock>::type() && connection.md5sum == Recorded<SampleBlock>::md5())
      samples_.emplace();
    if (type == Recorded<ForceBlock>::type() && connection.md5sum == Recorded<ForceBlock>::md5())
      forces_.emplace();
    if (type == Recorded<plain::NodeHealth>::type() &&
        connection.md5sum == Recorded<plain::NodeHealth>::md5())
      nodes_ = nodes;
    account_.sampled = samples_ || forces_;
  }

  void add(const std::uint8_t* data, std::size_t size) {
    ++account_.messages;
    if (has_header_ && size >= HEADER_SIZE) addHeader(headerOf(data));
    if (samples_) {
      const SampleBlock& b = samples_->decode(data, size);
      add({account_.topic, b.stamp, b.sample_rate, b.first_index, b.size(), notFinite(b.samples)});
    } else if (forces_) {
      const ForceBlock& b = forces_->decode(data, size);
      std::uint64_t not_finite = 0;
      for (const auto& axis : b.force) not_finite += notFinite(axis);
      add({account_.topic, b.stamp, b.sample_rate, b.first_index, b.force[0].size(), not_finite});
    } else if (nodes_) {
      nodes_->add(data, size);
    }
  }

  StreamAccount account() const {
    StreamAccount result = account_;
    if (last_stamp_ > first_stamp_)
      result.rate_seen = static_cast<double>(last_first_ - first_first_) / (last_stamp_ - first_stamp_);
    return result;
  }
  const std::vector<IndexRange>& ranges() const { return ranges_; }
  // [s] of a sample, at the mean rate of the stamps.
  double stampOf(std::uint64_t index) const {
    const double rate = account().rate_seen;
    return rate > 0.0 ? first_stamp_ + (static_cast<double>(index) - static_cast<double>(first_first_)) / rate
                      : first_stamp_;
  }

 private:
  void addHeader(const Header& header) {
    const auto lost = static_cast<std::int64_t>(header.sequence) - static_cast<std::int64_t>(next_sequence_);
    if (account_.messages > 1 && lost > 0) {
      account_.lost_messages += static_cast<std::uint64_t>(lost);
      gaps_->push_back(
          {StreamGap::Kind::messages, account_.topic, header.stamp, static_cast<std::uint64_t>(lost)});
    }
    next_sequence_ = header.sequence + 1;
  }

  void add(const Block& block) {
    if (block.count == 0) return;
    account_.samples += block.count;
    account_.not_finite += block.not_finite;
    account_.rate_stated = block.rate;
    if (ranges_.empty()) {
      first_stamp_ = block.stamp;
      first_first_ = block.first;
    } else if (const std::uint64_t next = ranges_.back().last + 1; block.first > next) {
      account_.lost_samples += block.first - next;
      gaps_->push_back({StreamGap::Kind::samples, block.topic, block.stamp, block.first - next});
    } else if (block.first < next) {
      const std::uint64_t repeated = std::min(next - block.first, block.count);
      account_.repeated_samples += repeated;
      gaps_->push_back({StreamGap::Kind::repeated, block.topic, block.stamp, repeated});
    }
    last_stamp_ = block.stamp;
    last_first_ = block.first;
    const std::uint64_t last = block.first + block.count - 1;
    if (!ranges_.empty() && block.first <= ranges_.back().last + 1) {
      ranges_.back().last = std::max(ranges_.back().last, last);
    } else {
      ranges_.push_back({block.first, last});
    }
  }

  bool has_header_;
  std::vector<StreamGap>* gaps_;
  NodeAccounts* nodes_ = nullptr;  // of a connection on health
  StreamAccount account_;
  std::optional<Recorded<SampleBlock>> samples_;
  std::optional<Recorded<ForceBlock>> forces_;
  std::uint32_t next_sequence_ = 0;
  std::vector<IndexRange> ranges_;
  double first_stamp_ = 0.0, last_stamp_ = 0.0;     // [s]
  std::uint64_t first_first_ = 0, last_first_ = 0;  // running indices of these blocks
};

using Streams = std::list<Stream>;

using Publisher = std::pair<std::string, std::string>;  // of a topic

Publisher publisherOf(const Stream& stream) {
  const StreamAccount account = stream.account();
  return {account.topic, account.publisher};
}

// The newest stream of each publisher: it continues in the next part.
std::map<Publisher, Stream*> newestOf(Streams& streams) {
  std::map<Publisher, Stream*> newest;
  for (Stream& stream : streams) newest[publisherOf(stream)] = &stream;
  return newest;
}

// The sensor whose running index the forces have: of those recorded the one with most samples of them.
const Stream* sensorOf(const Streams& streams, const Stream& forces) {
  const Stream* best = nullptr;
  std::uint64_t least = 0;
  for (const Stream& stream : streams) {
    const std::string topic = stream.account().topic;
    if (topic != names::absolute(names::DYNAMOMETER) && topic != names::absolute(names::SPINDLE_FORCE))
      continue;
    std::uint64_t missing = 0;
    for (const IndexRange& range : missingRanges(forces.ranges(), stream.ranges())) missing += range.size();
    if (!best || missing < least) {
      best = &stream;
      least = missing;
    }
  }
  return best;
}

}  // namespace

std::uint64_t RecordingAccount::lostByNodes() const {
  std::uint64_t lost = 0;
  for (const InputAccount& input : inputs) lost += input.lost;
  return lost;
}

std::vector<IndexRange> missingRanges(const std::vector<IndexRange>& all,
                                      const std::vector<IndexRange>& present) {
  std::vector<IndexRange> missing;
  if (present.empty()) return missing;
  const std::uint64_t begin = present.front().first, end = present.back().last;
  std::size_t p = 0;
  for (const IndexRange& range : all) {
    std::uint64_t at = std::max(range.first, begin);
    const std::uint64_t last = std::min(range.last, end);
    while (at <= last) {
      while (p < present.size() && present[p].last < at) ++p;
      if (p == present.size()) break;
      if (present[p].first > at) missing.push_back({at, std::min(last, present[p].first - 1)});
      at = present[p].last + 1;
    }
  }
  return missing;
}

RecordingAccount accountOf(const std::vector<std::string>& parts,
                           const std::function<void(double)>& progress) {
  constexpr std::uint64_t REPORTED = 4096;  // messages between two reports of the progress
  RecordingAccount result;
  Streams streams;
  NodeAccounts nodes;
  for (std::size_t part = 0; part < parts.size(); ++part) {
    const std::unique_ptr<RecordingFile> file = openRecording(parts[part]);
    std::map<Publisher, Stream*> earlier = newestOf(streams);
    std::map<std::uint32_t, Stream*> of_connection;
    RecordingFile::Entry entry;
    for (std::uint64_t count = 0; file->next(&entry); ++count) {
      if (progress && count % REPORTED == 0)
        progress((static_cast<double>(part) + file->share()) / static_cast<double>(parts.size()));
      const RecordedConnection& connection = file->connection(entry);
      Stream*& stream = of_connection[entry.connection];
      if (!stream) {
        Stream begun(connection, &result.gaps, &nodes);
        const auto continued = earlier.extract(publisherOf(begun));
        stream = continued ? continued.mapped() : &streams.emplace_back(std::move(begun));
      }
      try {
        stream->add(file->data(entry), entry.size);
      } catch (const Error& error) {
        throw Error(parts[part] + ": topic " + connection.topic + ": " + error.what());
      }
    }
  }
  if (progress) progress(1.0);
  for (const Stream& stream : streams) {
    result.streams.push_back(stream.account());
    if (result.streams.back().topic != names::absolute(names::FORCE_COMPENSATED)) continue;
    const Stream* const sensor = sensorOf(streams, stream);
    if (!sensor) continue;
    for (const IndexRange& range : missingRanges(sensor->ranges(), stream.ranges()))
      result.gaps.push_back({StreamGap::Kind::unprocessed, result.streams.back().topic,
                             sensor->stampOf(range.first), range.size()});
  }
  result.inputs = nodes.inputs();
  std::stable_sort(result.streams.begin(), result.streams.end(),
                   [](const StreamAccount& a, const StreamAccount& b) { return a.topic < b.topic; });
  return result;
}

}  // namespace smartmill
