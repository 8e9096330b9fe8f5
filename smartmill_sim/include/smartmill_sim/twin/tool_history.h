#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <vector>

namespace smartmill::sim {

/// Position and velocity of the tool.
struct ToolMotion {
  double angle = 0.0;                          ///< [rad] immersion angle of tooth 1 at its tip
  double speed = 0.0;                          ///< [rad/s] of the spindle, >= 0
  std::array<double, 2> centre{{0, 0}};        ///< [m] x, y of the undeflected tool
  std::array<double, 2> velocity{{0, 0}};      ///< [m/s] of the undeflected tool
  double sink = 0.0;                           ///< [m/s] along the axis, into the work
  std::array<double, 2> displacement{{0, 0}};  ///< [m] deflection of the tip
  std::array<double, 2> rate{{0, 0}};          ///< [m/s] of the displacement
};

/// Feed per angle of the spindle [m/rad]. @throws Error if the spindle is at rest.
std::array<double, 2> feedOf(const ToolMotion& motion);

/// Motion of the tool in constant time steps since the first contact, and where it was some angle of the
/// spindle ago.
class ToolHistory {
 public:
  using Vector = std::array<double, 2>;
  /// Interpolation point of the history.
  struct Point {
    /// Cubic through the four steps around a point so many steps ago.
    static Point at(double steps);
    /// Derivatives of the weights per step farther back.
    std::array<double, 4> weightSlopes() const;

    double ago = 0.0;                 // [steps]
    std::size_t steps = 0;            // whole steps of ago
    std::array<double, 4> weights{};  // of the samples steps + 2, steps + 1, steps, steps - 1 ago
  };
  /// Delay by an angle of the spindle.
  struct Delay {
    double turn = 0.0;  // [rad]
    Point point;
    long valid_regime = -1;  // regime of point and fed
    long updated_at = -1;    // step of the other values
    bool within_history = false;
    std::array<double, 2> displacement{};  // [m] at that time
    std::array<double, 2> fed{};           // [m] feed since then
  };

  /// @param time_step [s] > 0
  explicit ToolHistory(double time_step) : time_step_(time_step) {}

  /// Present feed of a tool that is about to cut. @throws Error as feedOf() does
  void setFeed(const ToolMotion& now) { feed_ = feedOf(now); }
  /// Drops the history: the earlier motion is the present one without vibration.
  void clear(const ToolMotion& now);
  /// Advances angle, feed and regime to the motion of a step.
  void advance(const ToolMotion& now);
  /// Ends the step. @param displacement [m] of the tip @param with_slope whether largestSlope() is needed
  void endStep(const Vector& displacement, bool with_slope);

  const ToolMotion& now() const { return now_; }
  const Vector& feed() const { return feed_; }  ///< [m/rad]
  double stepsPerRadian() const { return 1.0 / (now_.speed * time_step_); }
  /// Speed and feed are constant within a regime.
  long regime() const { return regime_; }
  /// Whether speed and feed have been constant over an angle [rad]; before the history they were constant.
  bool isSteadyOver(double turn) const;
  /// Largest deflection [m] and slope of the vibration [m/rad] in the history.
  double largestDeflection() const { return std::max(largest_deflection_[0], largest_deflection_[1]); }
  double largestSlope() const { return largest_slope_; }

  /// Index of the delay by an angle [rad].
  std::size_t delayOf(double turn);
  double rotation() const { return rotation_now_; }                       ///< [rad] since the first contact
  double turnOf(std::size_t delay) const { return delays_[delay].turn; }  ///< [rad]
  const Delay& at(std::size_t delay) {
    return delays_[delay].updated_at == count_ ? delays_[delay] : update(delays_[delay]);
  }

  /// step(k, displacement): displacements around a point; none before the history.
  template <class Step>
  void forEachStep(const Point& at, Step&& step) const {
    const std::size_t size = displacement_.size();
    const long available = std::min(count_, static_cast<long>(size)), first = static_cast<long>(at.steps) + 2;
    for (std::size_t k = 0; k < 4; ++k) {
      const long ago = first - static_cast<long>(k);
      if (ago <= available) step(k, displacement_[ring(count_ - ago, size)]);
    }
  }

 private:
  /// Index of a step in a ring whose size is a power of two.
  static std::size_t ring(long step, std::size_t size) { return static_cast<std::size_t>(step) & (size - 1); }
  const Delay& update(Delay& delay);
  void search(Delay& delay);
  void grow();

  double time_step_;
  ToolMotion now_;
  Vector feed_{{0, 0}}, first_feed_{{0, 0}};  // [m/rad] now, at the first contact
  // Ring buffers of each step since the first contact, newest at count_ - 1.
  std::vector<Vector> displacement_, centre_;  // [m]
  std::vector<double> rotation_;               // [rad] since the first step
  long count_ = 0;
  double rotation_now_ = 0.0;
  std::size_t longest_delay_ = 0;  // longest delay so far [steps]
  // [m] Largest deflection and largest change per step, in the present and in the previous cycle of the ring.
  Vector largest_deflection_{{0, 0}}, largest_change_{{0, 0}};
  double largest_slope_ = 0.0;  // [m/rad]
  long regime_ = 0;
  double regime_start_ = 0.0;  // [rad]
  std::vector<Delay> delays_;
};

}  // namespace smartmill::sim
