#include "smartmill_launch/comparison/topic_comparison.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "smartmill_core/formatted.h"

namespace smartmill::session {
namespace {

constexpr double INFINITE = std::numeric_limits<double>::infinity();

bool equal(double a, double b) {
  return a == b || (std::isnan(a) && std::isnan(b));
}

bool equal(const ResultRecord& a, const ResultRecord& b) {
  return a.words == b.words && a.values.size() == b.values.size() &&
         std::equal(a.values.begin(), a.values.end(), b.values.begin(),
                    [](double x, double y) { return equal(x, y); });
}

}  // namespace

bool TopicDifference::same() const {
  return different == 0 && contradictions == 0 && first_only == 0 && second_only == 0;
}

bool TopicDifference::sameButFor(double share) const {
  const double alone = static_cast<double>(first_only + second_only);
  return different == 0 && contradictions == 0 && alone <= share * (static_cast<double>(common) + alone);
}

std::string TopicDifference::text(const std::string& topic) const {
  std::string out = formatted("%-22s %-9s %7zu common, %zu different", topic.c_str(),
                              same() ? "same" : "DIFFERENT", common, different);
  if (different > 0) {
    out += formatted(" (largest %.3g of %.3g; first at %s)", largest, scale, where.c_str());
  }
  const auto add = [&](std::size_t count, const char* what) {
    if (count == 0) return;
    out += formatted(", %zu %s", count, what);
  };
  add(first_only, "only in the first");
  add(second_only, "only in the second");
  if (!missing.empty()) out += " (first: " + missing + ")";
  add(contradictions, "contradictory within one recording");
  add(first_ends, "of the first outside the time of the second");
  add(second_ends, "of the second outside the time of the first");
  return out;
}

TopicComparison::TopicComparison(double slack)
    : slack_(slack), common_from_(INFINITE), common_to_(-INFINITE) {
}

void TopicComparison::addFirst(ResultRecord record) {
  const auto existing = first_.find(record.key);
  if (existing == first_.end()) {
    std::string key = record.key;
    first_.emplace(std::move(key), std::move(record));
  } else if (!equal(existing->second, record)) {
    ++difference_.contradictions;
  }
}

void TopicComparison::addSecond(const ResultRecord& record) {
  const auto match = first_.find(record.key);
  if (match == first_.end()) {
    second_only_.emplace(record.key, record.stamp);
    return;
  }
  const ResultRecord& other = match->second;
  // A repeated result (latched topic) counts once; a repetition that differs is a difference.
  const bool repeated = !matched_.insert(record.key).second;
  if (!repeated) ++difference_.common;
  common_from_ = std::min(common_from_, record.stamp);
  common_to_ = std::max(common_to_, record.stamp);
  const std::size_t size = std::min(record.values.size(), other.values.size());
  for (std::size_t i = 0; i < size; ++i) {
    const double a = other.values[i], b = record.values[i];
    if (std::isfinite(a)) difference_.scale = std::max(difference_.scale, std::abs(a));
    if (equal(a, b)) continue;
    difference_.largest = std::max(difference_.largest, std::isfinite(a - b) ? std::abs(a - b) : INFINITE);
  }
  if (equal(other, record)) return;
  ++difference_.different;
  if (difference_.where.empty()) difference_.where = record.key;
}

TopicDifference TopicComparison::result(double from) const {
  TopicDifference difference = difference_;
  double earliest = INFINITE;
  const auto classify = [&](const std::string& key, double stamp, std::size_t& within, std::size_t& ends) {
    const bool begin = stamp < common_from_ && stamp >= common_from_ - slack_;
    const bool end = stamp > common_to_ && stamp <= common_to_ + slack_;
    ++(begin || end ? ends : within);
    if (begin || end || stamp >= earliest) return;
    earliest = stamp;
    difference.missing = key;
  };
  for (const auto& [key, record] : first_) {
    if (matched_.count(key)) continue;
    if (record.stamp < from) {
      ++difference.first_ends;
    } else {
      classify(key, record.stamp, difference.first_only, difference.first_ends);
    }
  }
  for (const auto& [key, stamp] : second_only_) {
    classify(key, stamp, difference.second_only, difference.second_ends);
  }
  return difference;
}

}  // namespace smartmill::session
