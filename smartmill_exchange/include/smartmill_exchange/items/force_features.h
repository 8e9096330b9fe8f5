#pragma once

#include <array>
#include <deque>
#include <optional>
#include <vector>

#include "smartmill_core/signal/angle_track.h"
#include "smartmill_core/signal/streams.h"

namespace smartmill::exchange {

/// Peaks and effective values of the force over whole revolutions of the spindle.
struct ForceFeatures {
  double stamp = 0.0;                      ///< [s] end of the last revolution
  int revolutions = 0;                     ///< [1]
  double peak = 0.0;                       ///< [N] largest resultant in the plane of x and y
  std::array<double, 3> largest{};         ///< [N] largest magnitude of x, y, z
  std::array<double, 3> rms{};             ///< [N] root mean square of x, y, z, with the mean
  std::vector<double> peak_of_tooth = {};  ///< [N] as peak, of each tooth; empty: number of teeth unknown
};

/// Divides a stream of force blocks into revolutions, which begin at the spindle angle 0, and revolutions
/// into teeth: the samples within half a tooth pitch of the middle of a tooth's engagement. A revolution with
/// an invalid sample (NaN) is left out.
class ForceFeatureMaker {
 public:
  /// @param interval [s] results cover at least this time, and at least one revolution
  explicit ForceFeatureMaker(double interval) : interval_(interval) {}

  void push(const SpindleAngle& angle);
  /// A block waits for angle readings up to its end, at most PATIENCE.
  void push(const ForceBlock& block);
  /// @param teeth [1] 0: unknown @param middle [rad] immersion angle of the middle of the engagement
  void setTool(int teeth, double middle);
  void reset();

  /// Results since the last call, oldest first.
  std::vector<ForceFeatures> take();

  static constexpr double PATIENCE = 0.2;  ///< [s] of blocks, then angles are extrapolated

 private:
  struct Sums {
    bool valid = true;
    double peak = 0.0;
    std::array<double, 3> largest{}, squares{};
    std::vector<double> peak_of_tooth;
    std::size_t samples = 0;
    int revolutions = 0;
  };
  void process(const ForceBlock& block);
  void add(double angle, const std::array<double, 3>& force);
  void endRevolution(double stamp);
  Sums noSums() const;

  double interval_;
  AngleTrack angle_;
  std::deque<ForceBlock> waiting_;
  int teeth_ = 0;
  double middle_ = 0.0;
  std::optional<double> last_angle_;  // of the sample before, in the running revolution
  bool whole_ = false;                // the running revolution began at angle 0
  double began_ = 0.0;                // [s] of the sums
  Sums revolution_, sums_;
  std::vector<ForceFeatures> results_;
};

}  // namespace smartmill::exchange
