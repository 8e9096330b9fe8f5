#pragma once

#include <cstddef>

namespace smartmill {

/// How estimateModes() searches. Evidence is the Wald statistic of a mode over its largest value by chance.
struct ModalSearchOptions {
  // Start values.
  /// [1] Start values are fitted to at most this accuracy, as share of the FRF: real FRFs have repeatable
  /// misfit.
  double start_misfit = 0.01;
  /// A pole that persists over 1 / this of the orders is a start value at once; weaker ones are tried later.
  int steady_share = 5;
  /// [1] The first lines begin near zero when the last of them has at least this multiple of the first
  /// frequency; a mass line has constant acceleration to within `mass_line`, as the edge of a mode has not.
  double from_zero = 2.0, mass_line = 0.3;
  /// Lines of the smallest segment of the band that is searched separately, its order and the step between
  /// orders: a segment has a few modes. `part_worth` orders of a segment count as one of the whole band.
  std::size_t least_part = 160;
  int part_order = 16, part_order_step = 2, part_worth = 3;
  std::size_t most_at_start = 32;  ///< modes that are fitted together at the start, which limits its time
  std::size_t most_tries = 20;     ///< candidates, in addition to two for each mode, which limits the time

  // Windows.
  double reach = 8.0;         ///< [half widths] of a window on either side of its modes: 1.5 % of the peak
  double least_lines = 20.0;  ///< the same in lines, for the background parabola
  double together = 4.0;  ///< [half widths] modes nearer than this bias each other and are fitted together
  std::size_t most_together = 6;  ///< of these, the nearest ones; more are not separable
  /// Least distance of a mode from the ends of the band, in lines and in half widths: a truncated peak is not
  /// significant.
  double from_end = 2.5, half_widths_from_end = 1.5;
  double search_lines = 6.0, fit_lines = 40.0;  ///< a half width, in the search and in the last fit; more
                                                ///< lines are averaged in groups
  int steps = 8, last_steps = 25;               ///< iterations of a fit in the search and of the last one
  double roughly = 1e-4, closely = 1e-8;        ///< [1] change of the squares that ends them

  // Decisions.
  double chance =
      0.05;  ///< [1] probability of a false mode in a record; the bound used is five times as strict
  /// [1] Power of misfit over noise above which the misfit is more than noise: noise alone varies by less.
  double more_than_noise = 2.0;
  /// [1] Evidence of a significant mode; above 1 because the misfit of real records is not uniform noise.
  double proven = 2.5;
  /// [1] Evidence above which a mode stays in the fit as a doubt, so that its share does not count as misfit
  /// of the others.
  double doubtful = 0.35;
  double duplicate = 0.02;       ///< [1] evidence below which a start value repeats another one
  double widest_damping = 0.25;  ///< [1] wider peaks are indistinguishable from the background parabola
  /// [1] Median coherence within a mode's width. Where it is lower in every FRF, the force had no power there
  /// (between the lobes of a pulse), and the curvature is a bias of the average.
  double coherent = 0.3;
  /// [1] The same below which hits disagree: the average of a drifting resonance is not a mode. Noise alone
  /// gives this at a signal of three times the noise.
  double repeatable = 0.9;
  /// [deg] Phase to a neighbour, modulo 180 deg, above which a mode is a flank where hits disagree. Lightly
  /// damped modes are within a few degrees; the flanks of an averaged peak have 30 to 60 deg.
  double flank_phase = 20.0;
  double dominant = 1.5;  ///< [1] a mode so many times as large as its neighbour is not the neighbour's flank

  // Modes by magnitude.
  double clear_peak = 12.0;  ///< [1] of the magnitude around it: such a peak is a mode whatever its phase
  std::size_t about = 50;    ///< [lines] on either side, for that magnitude: wider than peaks
  int dampings = 120;        ///< of the average over the damping of a peak narrower than the lines
};

}  // namespace smartmill
