#pragma once

#include <array>
#include <complex>
#include <cstdint>
#include <random>
#include <vector>

#include "smartmill_core/cutting/tool.h"

namespace smartmill {

/// One drawn machine with its tool.
struct ProductionMachine {
  ToolGeometry tool;
  CuttingCoefficients sharp;
  double runout = 0.0, runout_angle = 0.0;                // [m], [rad]
  double speed = 0.0;                                     // [rad/s]
  double acceleration = 0.0, spindle_acceleration = 0.0;  // [m/s2], [rad/s2]
  double ripple = 0.0, ripple_frequency = 0.0;            // [1] of the speed, [Hz]
  double noise = 0.0, angle_noise = 0.0;                  // [N], [rad]
  double edge_growth = 0.0;                               // [1/s] of cutting
};
ProductionMachine drawMachine(std::mt19937_64& random);

/// Milling of a rigid tool in straight cuts one after the other, sample by sample (two instants each), with
/// everything that changes the force in production without damage: entries and exits through flat faces, gaps
/// of the stock, changes of radial depth, corners, feed and spindle overrides, feed hold and restart, hard
/// spots, chatter, speed ripple, runout, wear, noise, lost samples. A tooth can be broken off at any time.
///
/// The chip of each tooth and slice of its helix is the least over all earlier passes of one revolution of
/// n c sin(phi) + difference of the radii (formats.md), c of the present feed and speed. Written without code
/// of the detection.
class ProductionForce {
 public:
  static constexpr double RATE = 10000.0;  // [Hz]

  struct Sample {
    double time = 0.0, turned = 0.0;  // [s], [rad] as the encoder measures it
    double fx = 0.0, fy = 0.0;        // [N]
    bool lost = false;                // by the acquisition
    bool cutting = false;             // some tooth meets material, and the axes move
    double revolutions = 0.0;         // [1] true
    std::complex<double> cut_force;   // [N] without noise and chatter
  };

  ProductionForce(const ProductionMachine& machine, std::uint64_t seed);

  const Sample& next();
  const Sample& last() const { return sample_; }
  /// From now on this tooth is missing.
  void breakTooth(int tooth);
  const char* stage() const { return stage_; }          // of the present cut, for messages
  double meanForce() const { return mean_force_; }      // [N] of the last 0.1 s
  double feedPerTooth() const;                          // [m]
  double cuttingTime() const { return cutting_time_; }  // [s]

 private:
  enum class Feature { none, gap, wider, narrower, corner, hard_spot };
  struct Arc {
    double entry, exit;
  };
  void drawCut();
  void drawFeature();
  void drawEvents();
  void move();
  void contact();
  void addArc(double entry, double exit);
  double uniform(double low, double high) { return low + (high - low) * unit_(random_); }
  double logUniform(double low, double high);
  bool chance(double per_second);
  double radiusOf(int tooth, double turned) const;
  std::complex<double> cuttingForce(double turned);

  ProductionMachine machine_;
  std::mt19937_64 random_;
  std::uniform_real_distribution<double> unit_{0.0, 1.0};
  std::normal_distribution<double> normal_{0.0, 1.0};
  std::vector<double> radius_;  // [m] of each tooth
  int broken_ = -1;
  double broken_from_ = 0.0;  // [rad] turned

  // Motion.
  double time_ = 0.0, turned_ = 0.0, speed_ = 0.0, speed_target_ = 0.0;
  double feed_ = 0.0, override_ = 1.0, hold_until_ = 0.0;  // [m/s], [1], [s]
  double direction_ = 0.0;                                 // [rad] of the feed
  // Cut: lengths in m along it, the tool's centre at place_; faces at 0 and length_.
  double place_ = 0.0, length_ = 0.0, depth_ = 0.0, entry_ = 0.0, exit_ = 0.0, chip_feed_ = 0.0;
  Feature feature_ = Feature::none;
  double feature_at_ = 0.0, feature_length_ = 0.0, feature_size_ = 0.0;
  double hardness_ = 1.0;
  std::vector<Arc> arcs_;
  int slices_ = 1;
  int until_contact_ = 0;  // samples until the arcs are computed again
  // Chatter.
  double chatter_ = 0.0, chatter_size_ = 0.0, chatter_growth_ = 0.0, chatter_until_ = 0.0,
         chatter_phase_ = 0.0, chatter_order_ = 0.0, chatter_direction_ = 0.0;
  double lost_until_ = 0.0;  // [s]
  double mean_force_ = 0.0;  // [N]
  double cutting_time_ = 0.0, worn_ = 0.0;
  const char* stage_ = "air";
  Sample sample_;
};

}  // namespace smartmill
