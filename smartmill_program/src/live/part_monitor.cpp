#include "smartmill_program/live/part_monitor.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "smartmill_core/names.h"

namespace smartmill::program {
namespace {

constexpr double LATE = 0.02;  // [s] stamps of the controller's states, and the length of a force block

}  // namespace

PartMonitor::PartMonitor(std::shared_ptr<const LiveProgram> program, double period, double hold_back,
                         Output output)
    : program_(std::move(program)),
      period_(period),
      output_(std::move(output)),
      sorter_(hold_back),
      places_(sorter_.addOptional(names::CNC_STATE)),
      blocks_(sorter_.addOptional(names::FORCE_COMPENSATED)),
      verdicts_(sorter_.addEvents(names::CHATTER_STATE)),
      predictions_(program_->pieces.size()) {
  sorter_.onRestart([this] { present_.reset(); });
}

void PartMonitor::setPredictions(std::vector<PiecePrediction> predictions) {
  predictions_ = std::move(predictions);
}

void PartMonitor::push(const PartPlace& place) {
  sorter_.push(places_, place.stamp, [this, place] { handle(place); });
}

void PartMonitor::push(const ForceBlock& block) {
  sorter_.push(blocks_, block.stamp, [this, block] { handle(block); });
}

void PartMonitor::push(const PartVerdict& verdict) {
  sorter_.push(verdicts_, verdict.stamp, [this, verdict] {
    if (present_) present_->verdicts.push_back(verdict);
  });
}

void PartMonitor::handle(const ForceBlock& block) {
  if (!present_) return;
  present_->compensated = present_->compensated && block.isCompensated();
  for (std::size_t i = 0; i < block.force[0].size(); ++i) {
    const double force = std::hypot(block.force[0][i], block.force[1][i]);
    if (!(force <= present_->peak_force)) present_->peak_force = force;
  }
}

void PartMonitor::handle(const PartPlace& place) {
  if (!place.place) {
    present_.reset();
    return;
  }
  if (present_ && place.part == present_->part) {
    if (place.stamp - present_->begin < period_) return;
    present_->stamp = place.stamp;
    present_->to = *place.place;
    present_->last_line = place.line;
    const double slack = place.feed * LATE;
    present_->predicted = predictedBetween(present_->from - slack, present_->to + slack);
    output_(*present_);
  }
  present_ = PartProgress();
  present_->begin = place.stamp;
  present_->from = *place.place;
  present_->first_line = place.line;
  present_->part = place.part;
}

PiecePrediction PartMonitor::predictedBetween(double from, double to) const {
  const std::vector<PathPiece>& pieces = program_->pieces;
  const auto first = std::upper_bound(pieces.begin(), pieces.end(), from,
                                      [](double place, const PathPiece& piece) { return place < piece.to; });
  PiecePrediction all;
  for (auto piece = first; piece != pieces.end() && piece->from < to; ++piece) {
    const PiecePrediction& one = predictions_[static_cast<std::size_t>(piece - pieces.begin())];
    if (!(one.peak_force <= all.peak_force) && std::isfinite(one.peak_force)) all.peak_force = one.peak_force;
    if (!(one.margin >= all.margin) && std::isfinite(one.margin)) all.margin = one.margin;
  }
  return all;
}

}  // namespace smartmill::program
