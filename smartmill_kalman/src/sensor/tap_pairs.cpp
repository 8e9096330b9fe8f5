#include "smartmill_kalman/sensor/tap_pairs.h"

#include <cmath>
#include <utility>

#include "smartmill_core/formatted.h"
#include "smartmill_kalman/sensor/block_channels.h"

namespace smartmill::kalman {

TapPairs::TapPairs(double patience) : patience_(patience) {
}

void TapPairs::clear() {
  hammer_.clear();
  response_.clear();
  fault_.clear();
}

void TapPairs::addHammer(const SampleBlock& block) {
  const std::size_t c = columnOf(block, "hammer", "N");
  for (std::size_t i = 0; i < block.size(); ++i)
    hammer_.push_back({block.timeOf(i), block.first_index + i, block.sample_rate, {block.at(i, c)}});
  checkPatience();
}

void TapPairs::addResponse(double time, std::uint64_t index, double rate, std::vector<double> values) {
  response_.push_back({time, index, rate, std::move(values)});
  checkPatience();
}

// next() has taken all pairs: the remainder waits for the other stream.
void TapPairs::checkPatience() {
  for (const auto* waiting : {&hammer_, &response_}) {
    if (waiting->empty() || waiting->back().time - waiting->front().time <= patience_) continue;
    fault_ = std::string("no samples of ") + (waiting == &hammer_ ? "the force sensor" : "the hammer") +
             " with the other's running index";
  }
}

std::optional<TapPairs::Pair> TapPairs::next() {
  while (fault_.empty() && !hammer_.empty() && !response_.empty()) {
    if (hammer_.front().index != response_.front().index) {
      (hammer_.front().index < response_.front().index ? hammer_ : response_).pop_front();
      continue;
    }
    const Sample h = std::move(hammer_.front());
    Sample r = std::move(response_.front());
    hammer_.pop_front();
    response_.pop_front();
    if (h.rate != r.rate) {
      fault_ = "hammer and force sensor differ in sample rate";
    } else if (std::abs(h.time - r.time) > 0.5 / h.rate) {
      fault_ = formatted(
          "hammer and force sensor: stamps of the same running index differ by %.2f ms, expected less than "
          "half a sampling interval; connect both to the same instrument",
          1e3 * (h.time - r.time));
    } else {
      return Pair{r.time, r.index, r.rate, h.values[0], std::move(r.values)};
    }
  }
  return std::nullopt;
}

}  // namespace smartmill::kalman
