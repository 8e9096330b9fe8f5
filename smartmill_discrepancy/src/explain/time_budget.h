#pragma once

#include <atomic>
#include <functional>
#include <utility>

namespace smartmill::discrepancy {

/// Time budget of a computation in stages. Each stage ends at a share of the budget, since the later ones
/// need time as well.
class TimeBudget {
 public:
  /// @param elapsed [s] since the begin; empty: no limit @param seconds [s] > 0
  TimeBudget(std::function<double()> elapsed, double seconds)
      : elapsed_(std::move(elapsed)), seconds_(seconds) {}

  /// @param ends_at [1] share of the budget
  void beginStage(double ends_at) { ends_at_ = ends_at; }
  /// Whether the time of the stage has elapsed; to be polled, from any thread.
  bool isStageOver() {
    const bool over = elapsed_ && elapsed_() >= ends_at_ * seconds_;
    if (over) spent_ = true;
    return over;
  }
  /// Whether any stage was ended.
  bool isSpent() const { return spent_; }

 private:
  std::function<double()> elapsed_;
  double seconds_;
  double ends_at_ = 1.0;
  std::atomic<bool> spent_{false};
};

}  // namespace smartmill::discrepancy
