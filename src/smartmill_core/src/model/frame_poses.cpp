#include "smartmill_core/model/frame_poses.h"

#include <algorithm>
#include <cmath>
#include <cstddef>

#include "smartmill_core/error.h"
#include "smartmill_core/frames.h"

namespace smartmill {

const FramePoses& usualFrames() {
  static const FramePoses usual{{frames::TABLE, {frames::MACHINE, {}, {{0, 0, 0, 1}}}},
                                {frames::DYNAMOMETER, {frames::TABLE, {}, {{0, 0, 0, 1}}}},
                                {frames::HAMMER, {frames::MACHINE, {}, {{0, 0, 0, 1}}}},
                                {frames::TOOL_TIP, {frames::SPINDLE, {}, {{0, 0, 0, 1}}}},
                                {frames::SPINDLE_SENSOR, {frames::SPINDLE, {}, {{0, 0, 0, 1}}}}};
  return usual;
}

bool PlacedFrame::isTurned() const {
  constexpr double ROUNDING = 1e-9;
  for (std::size_t i = 0; i < 9; ++i) {
    if (std::abs(rotation[i] - (i % 4 == 0 ? 1.0 : 0.0)) > ROUNDING) return true;
  }
  return false;
}

void PlacedFrame::carry(std::array<double, 3>& force, std::array<double, 3>& moment) const {
  force = frames::rotate(rotation, force);
  moment = frames::rotate(rotation, moment);
  moment[0] += position[1] * force[2] - position[2] * force[1];
  moment[1] += position[2] * force[0] - position[0] * force[2];
  moment[2] += position[0] * force[1] - position[1] * force[0];
}

PlacedFrame placedFrame(const FramePoses& poses, const std::string& frame, const std::string& in) {
  FramePoses all = poses;
  all.insert(usualFrames().begin(), usualFrames().end());
  PlacedFrame placed;
  std::string at = frame;
  for (std::size_t i = 0; at != in; ++i) {
    const auto found = all.find(at);
    if (found == all.end() || i > all.size())
      throw Error("frames: no transform from " + frame + " to " + in + ": the chain ends at " + at);
    const FramePose& pose = found->second;
    const std::array<double, 9> r = frames::rotationMatrix(pose.rotation);
    placed.position = frames::rotate(r, placed.position);
    for (std::size_t k = 0; k < 3; ++k) placed.position[k] += pose.position[k];
    std::array<double, 9> product{};
    for (std::size_t row = 0; row < 3; ++row) {
      for (std::size_t column = 0; column < 3; ++column) {
        for (std::size_t k = 0; k < 3; ++k)
          product[3 * row + column] += r[3 * row + k] * placed.rotation[3 * k + column];
      }
    }
    placed.rotation = product;
    at = pose.parent;
  }
  return placed;
}

}  // namespace smartmill
