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
    : block(move.block), line(move.line), tool(move.tool), operation(move.operation) {
}

void BlockSummary::add(const Step& step, const StepPrediction& prediction, double radius) {
  length += step.length;
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
  raise(radial_depth, step.contact.radialDepth(radius));
  lower(entry, step.contact.entry());
  raise(exit, step.contact.exit());
  raise(peak_force, prediction.force.peak_force);
  raise(peak_torque, prediction.force.peak_torque);
  raise(power, prediction.power);
  lower(margin, prediction.limit / step.contact.axialDepth());
}

}  // namespace smartmill::program
