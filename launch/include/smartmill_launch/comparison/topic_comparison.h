#pragma once

#include <cstddef>
#include <string>
#include <unordered_map>
#include <unordered_set>
#include <vector>

namespace smartmill::session {

/// A result taken apart: what it is about, and everything it says.
struct ResultRecord {
  std::string key;             ///< same in both recordings: sample index, or tool, point, direction and stamp
  double stamp = 0.0;          ///< [s]
  std::vector<double> values;  ///< in the message's units; NaN equals NaN
  std::vector<std::string> words;
};

/// What two recordings say on one topic.
struct TopicDifference {
  std::size_t common = 0;                       ///< results that both have
  std::size_t different = 0;                    ///< of these, not the same to the last digit
  std::size_t first_only = 0, second_only = 0;  ///< missing on the other side, within what both cover
  std::size_t first_ends = 0, second_ends = 0;  ///< missing on the other side, at begin or end
  std::size_t contradictions = 0;               ///< one recording says two things of one key
  double largest = 0.0;                         ///< largest difference of two values
  double scale = 0.0;                           ///< largest value of the topic
  std::string where;                            ///< key of the first difference
  std::string missing;                          ///< key of the first one of first_only and second_only
  bool same() const;
  /// As same(), with up to this share of all results [1] missing on one side or the other.
  bool sameButFor(double share) const;
  std::string text(const std::string& topic) const;  ///< one line
};

/// Compares the results of two recordings on one topic to the last digit, in whatever order they stand there.
class TopicComparison {
 public:
  /// @param slack [s] a recording may begin so much later or end so much earlier than the other: results
  /// before the first common one or after the last count as ends. 0: every result must be in both.
  explicit TopicComparison(double slack);

  void addFirst(ResultRecord record);
  /// All of the first recording must have come.
  void addSecond(const ResultRecord& record);

  TopicDifference result() const;

 private:
  double slack_;
  TopicDifference found_;
  std::unordered_map<std::string, ResultRecord> first_;
  std::unordered_map<std::string, double> second_only_;  // stamps
  std::unordered_set<std::string> seen_;
  double common_from_, common_to_;
};

}  // namespace smartmill::session
