#include "recordings/frame_tree.h"

#include <cmath>

namespace smartmill::kalman {
namespace {

constexpr double UNIT_TOLERANCE = 1e-3;  // [1] of a quaternion's squared length
constexpr int MOST_LINKS = 1000;         // a longer chain is a loop

using Quaternion = std::array<double, 4>;

Quaternion product(const Quaternion& a, const Quaternion& b) {
  const auto [ax, ay, az, aw] = a;
  const auto [bx, by, bz, bw] = b;
  return {aw * bx + ax * bw + ay * bz - az * by, aw * by + ay * bw + az * bx - ax * bz,
          aw * bz + az * bw + ax * by - ay * bx, aw * bw - ax * bx - ay * by - az * bz};
}

Quaternion inverse(const Quaternion& q) {
  return {-q[0], -q[1], -q[2], q[3]};
}

/// tf's first version wrote frames with a slash before the name.
std::string nameOf(const std::string& frame) {
  return !frame.empty() && frame.front() == '/' ? frame.substr(1) : frame;
}

}  // namespace

void FrameTree::add(const plain::TransformStamped& transform) {
  const std::string parent = nameOf(transform.header.frame_id), child = nameOf(transform.child_frame_id);
  const plain::Quaternion& q = transform.transform.rotation;
  const double squared = q.x * q.x + q.y * q.y + q.z * q.z + q.w * q.w;
  if (parent.empty() || child.empty() || parent == child || !(std::abs(squared - 1.0) < UNIT_TOLERANCE))
    return;
  links_[child] = {parent, {q.x, q.y, q.z, q.w}};
}

FrameTree::Climb FrameTree::climb(const std::string& from, const std::string& until) const {
  Climb climbed{from, {0.0, 0.0, 0.0, 1.0}};
  for (int i = 0; i < MOST_LINKS && climbed.top != until; ++i) {
    const auto link = links_.find(climbed.top);
    if (link == links_.end()) break;
    climbed = {link->second.parent, product(link->second.rotation, climbed.rotation)};
  }
  return climbed;
}

std::optional<std::array<double, 4>> FrameTree::rotation(const std::string& target,
                                                         const std::string& source) const {
  const std::string to = nameOf(target), from = nameOf(source);
  const Climb above_source = climb(from, to);
  if (above_source.top == to) return above_source.rotation;
  const Climb above_target = climb(to, above_source.top);
  if (above_target.top != above_source.top) return std::nullopt;
  return product(inverse(above_target.rotation), above_source.rotation);
}

}  // namespace smartmill::kalman
