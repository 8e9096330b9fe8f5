#include "smartmill_program/report/block_summary.h"

#include <algorithm>
#include <cmath>

namespace smartmill::program {
namespace {

// fmin and fmax ignore NaN.
void raise(double& most, double value) {
  most = std::fmax(most, value);
}
void lower(double& least, double value) {
  least = std::fmin(least, value);
}

}  // namespace

BlockSummary::BlockSummary(const Move& move)
    : block(move.block),
      line(move.line),
      tool(move.tool),
      operation(move.operation),
      name(move.name),
      speed(move.spindle_speed),
      feed(move.rapid ? 0.0 : move.feed) {
}

void BlockSummary::add(const Step& step, const StepPrediction& prediction) {
  length += step.length;
  holder_hit = holder_hit || step.holder_hit;
  time += step.time;
  if (step.move->rapid) {
    rapid_hit = rapid_hit || !step.air();
    volume += step.volume();
    return;
  }
  feed_time += step.time;
  if (step.air()) return;
  cut_time += step.time;
  volume += step.volume();
  face_volume += step.face_volume;
  raise(feed_per_tooth, prediction.feed_per_tooth);
  if (step.contact.empty()) return;
  raise(axial_depth, step.contact.axialDepth());
  raise(radial_depth, step.contact.radialDepth());
  lower(entry, step.contact.entry());
  raise(exit, step.contact.exit());
  raise(peak_force, prediction.force.peak_force);
  raise(peak_torque, prediction.force.peak_torque);
  raise(power, prediction.power);
  raise(chip, prediction.chip);
  raise(deflection, prediction.deflection);
  raise(chatter, prediction.chatter);
  lower(margin, prediction.limit / step.contact.axialDepth());
  if (std::isnan(wall_error) || std::abs(prediction.wall_error) > std::abs(wall_error))
    wall_error = prediction.wall_error;
}

std::string collisionText(const std::string& name, const std::vector<BlockSummary>& blocks) {
  const BlockSummary* first = nullptr;
  std::size_t others = 0;
  for (const BlockSummary& block : blocks) {
    if (!block.rapid_hit && !block.holder_hit) continue;
    if (first) {
      ++others;
    } else {
      first = &block;
    }
  }
  if (!first) return {};
  std::string text = name + ": line " + std::to_string(first->line) + ": " + first->operation + ": " +
                     (first->rapid_hit ? "a rapid move hits the stock" : "the holder hits the stock");
  if (others > 0) text += " (and " + std::to_string(others) + " more blocks)";
  return text;
}

}  // namespace smartmill::program
