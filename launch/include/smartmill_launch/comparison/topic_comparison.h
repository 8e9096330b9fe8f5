#pragma once

#include <cstddef>
#include <limits>
#include <string>
#include <unordered_map>
#include <unordered_set>
#include <vector>

namespace smartmill::session {

/// Key and contents of one result.
struct ResultRecord {
  std::string key;             ///< same in both recordings: sample index, or tool, point, direction and stamp
  double stamp = 0.0;          ///< [s]
  std::vector<double> values;  ///< in the message's units; NaN equals NaN
  std::vector<std::string> words;
};

/// Comparison of two recordings on one topic.
struct TopicDifference {
  std::size_t common = 0;                       ///< results in both
  std::size_t different = 0;                    ///< of these, different in any digit
  std::size_t first_only = 0, second_only = 0;  ///< missing in the other, within the common time
  std::size_t first_ends = 0, second_ends = 0;  ///< missing in the other, at the start or end
  std::size_t contradictions = 0;               ///< different results of one key in one recording
  double largest = 0.0;                         ///< largest difference of two values
  double scale = 0.0;                           ///< largest value of the topic
  std::string where;                            ///< key of the first difference
  std::string missing;                          ///< key of the first one of first_only and second_only
  bool same() const;
  /// As same(), but up to this share of all results [1] may be missing in either recording.
  bool sameButFor(double share) const;
  std::string text(const std::string& topic) const;  ///< one line
};

/// Compares the results of two recordings on one topic to the last digit, in any order.
class TopicComparison {
 public:
  /// @param slack [s] by which a recording may start later or end earlier than the other: results before the
  /// first common one or after the last one then count as ends. 0: every result must be in both.
  explicit TopicComparison(double slack);

  void addFirst(ResultRecord record);
  /// To be called after all results of the first recording were added.
  void addSecond(const ResultRecord& record);

  /// @param from [s] stamp of the first input in the first recording: its earlier results, which cannot be
  /// repeated, count as ends
  TopicDifference result(double from = -std::numeric_limits<double>::infinity()) const;

 private:
  double slack_;
  TopicDifference difference_;
  std::unordered_map<std::string, ResultRecord> first_;
  std::unordered_map<std::string, double> second_only_;  // stamps
  std::unordered_set<std::string> matched_;
  double common_from_, common_to_;
};

}  // namespace smartmill::session
