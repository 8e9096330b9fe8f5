#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <string>
#include <vector>

namespace smartmill {

/// Samples of a stream, by their running index: from first to last.
struct IndexRange {
  std::uint64_t first = 0, last = 0;

  std::uint64_t size() const { return last - first + 1; }
};

/// Part of a stream that a recording lacks or has twice.
struct StreamGap {
  enum class Kind {
    messages,    ///< the header's sequence number jumps: lost between publisher and recorder
    samples,     ///< the running index jumps: lost before publishing
    repeated,    ///< the running index goes back
    unprocessed  ///< samples of the sensor without a force
  };
  Kind kind = Kind::messages;
  std::string topic;
  double stamp = 0.0;       ///< [s] of the message after the gap
  std::uint64_t count = 0;  ///< messages or samples
};

/// What a recording has of one publisher of a topic.
struct StreamAccount {
  std::string topic, publisher;
  std::uint64_t messages = 0, lost_messages = 0;
  bool sampled = false;  ///< blocks of samples; else the following are 0
  std::uint64_t samples = 0, lost_samples = 0, repeated_samples = 0, not_finite = 0;
  double rate_stated = 0.0;  ///< [Hz]
  double rate_seen = 0.0;    ///< [Hz] samples over the stamps; 0: fewer than two blocks
};

/// What a node has received of a topic, by its messages on `health`: over all its starts in the recording.
struct InputAccount {
  std::string node, topic;
  std::uint32_t starts = 1;                              ///< the latest, in its launch
  std::uint64_t received = 0, dropped = 0, refused = 0;  ///< [1] messages
  std::uint64_t lost = 0;                                ///< [1] messages between publisher and node
};

/// Account of every message and sample of a recording.
struct RecordingAccount {
  std::vector<StreamAccount> streams;  ///< by topic
  std::vector<StreamGap> gaps;         ///< in the order of reception; samples without a force last
  std::vector<InputAccount> inputs;    ///< by node and topic

  std::uint64_t lostByNodes() const;  ///< [1] messages between publishers and nodes
  /// Whether the recording and the nodes have received everything.
  bool isComplete() const { return gaps.empty() && lostByNodes() == 0; }
};

/// Counts messages by the sequence numbers of their headers, samples of SampleBlock and ForceBlock by their
/// running index, and the samples of the force sensor that force/compensated lacks between its first and its
/// last; and what each node has received. What was lost before the first or after the last message of a
/// publisher leaves no trace.
/// @param parts files of one recording, in order; a publisher's messages and samples continue from one to the
/// next
/// @param progress as RecordingReader::run(). @throws Error naming a file that is damaged.
RecordingAccount accountOf(const std::vector<std::string>& parts,
                           const std::function<void(double)>& progress = {});

/// Parts of `all` that `present` lacks, both ascending and disjoint, within the range of `present`.
std::vector<IndexRange> missingRanges(const std::vector<IndexRange>& all,
                                      const std::vector<IndexRange>& present);

}  // namespace smartmill
