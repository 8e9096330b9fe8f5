#pragma once

#include <cstddef>

namespace smartmill {

// Limits by which hits are judged. They follow from the shapes of clean and faulty hits; the study
// hammer_hit_gate counts how many of 1,000 records per class they misjudge.

/// How the top of a clipped channel differs from a crest of ringing.
struct ClippingLimits {
  // Equal samples at the extreme, as a converter gives them.
  std::size_t equal = 3;    ///< [samples] of a clipped top; two occur by chance
  double fine_step = 3e-6;  ///< [1] resolution over the largest value below which two do not
  double top_share = 0.02;  ///< [1] of the largest value: samples so near the extreme belong to its crest

  // A top that is equal within the noise, as an amplifier gives it.
  double flat_noise = 5.0;    ///< [1] width of the top in deviations of the noise, which hardly exceeds it
  double flat_share = 0.002;  ///< [1] least width, of the largest value, where there is no noise
  double flat = 3.0;          ///< [samples] least length of the top
  /// [1] Fall next to the top, over that of a parabola as wide as the top. A parabola falls by 1, and each
  /// step is larger than the one before. A corner falls by more than `sharp`, and its next step is at most
  /// `round` times as large, unless it falls by more than `very_sharp`.
  double round = 1.35, sharp = 2.5, very_sharp = 6.0;

  // Many crests of equal height.
  std::size_t crowd = 8;    ///< [samples] at the top of all crests; a single round crest has fewer
  std::size_t crowded = 3;  ///< [1] samples at the top over those in the next two widths; a round crest: 1.4

  // Equal magnitude on both sides, which a decay does not have.
  std::size_t mirrored = 5;  ///< [samples] at both extremes
  std::size_t piled = 2;     ///< [1] as `crowded`; less, since both sides agree
};

/// When a free decay deviates from its linear prediction.
struct FreeDecayLimits {
  std::size_t order = 32;              ///< [1] of the prediction: sixteen modes
  std::size_t rows_a_coefficient = 3;  ///< [samples] for each coefficient; a shorter record has a lower order
  std::size_t segment = 8;             ///< [samples] of a slow deviation
  /// [1] A sample deviates from this multiple of the usual deviation and this share of the largest value on:
  /// a nonlinear sensor deviates by a few percent.
  double outlier = 12.0, outlier_share = 0.08;
  /// [1] The same for a segment, over which noise and nonlinearity average out.
  double deviation = 6.0, deviation_share = 0.004;
};

/// When a hit differs from the other hits of its point.
struct HitComparisonLimits {
  double gain_jump = 0.1;     ///< [1] of the gain; hits of one point repeat to a few percent
  double skew = 0.35;         ///< [samples] between the channels; a late trigger shifts by whole samples
  double by_noise = 3.0;      ///< [1] standard deviations by noise that are added to both
  double most_skew = 6.0;     ///< [samples] range of the shifts that are tried
  double skew_step = 0.1;     ///< [samples] between them, well below `skew`
  double strong_force = 0.2;  ///< [1] of the strongest line of the force, from which lines are used
};

/// When a hit cannot be used.
struct HitLimits {
  // Peak and noise.
  double clear = 10.0;       ///< [1] least ratio of the peak to the noise
  double above_noise = 8.0;  ///< [1] least rise of a fault in deviations of the noise: none by chance
  double soonest = 0.4e-3;   ///< [s] least time between two hits; before it the contact itself may bounce
  double dull = 0.05;        ///< [1] least force at the end of the required band, of its largest line

  // Single samples.
  std::size_t stuck = 8;      ///< [samples] equal one after another, away from zero
  std::size_t near = 12;      ///< [samples] on either side, from which the usual deviation is taken
  double spike = 25.0;        ///< [1] deviation of a sample from its neighbours over the usual one
  double spike_share = 0.12;  ///< [1] its least share of the largest value; high modes deviate as well
  double notch_share = 0.15;  ///< [1] depth of a notch in the contact, of the peak; contacts have none
  double lone_top = 2.5;  ///< [1] height of a false peak over its neighbours; contacts last several samples

  // Slow faults.
  double drift_share = 0.03;    ///< [1] level at the end of the record, of the largest value
  double ringing_share = 0.06;  ///< [1] of the remaining ringing, which may appear as a level
  double block = 5e-3;          ///< [s] over which the maximum of the response is taken: longer than a period
  /// [1] A block is a late bump when it exceeds an earlier one by `bump` and `bump_share` of the largest:
  /// beats of two modes rise less.
  double bump = 5.0, bump_share = 0.25;
  /// [1] Or by `rise` and `rise_share`, with an unpredicted power of `foreign` times the earlier one: beats
  /// are predicted.
  double rise = 1.5, rise_share = 0.06, foreign = 4.0;

  ClippingLimits clipping = {};
  FreeDecayLimits decay = {};
  HitComparisonLimits comparison = {};
};

}  // namespace smartmill
