#pragma once

#include <algorithm>
#include <cstddef>
#include <limits>
#include <vector>

#include "smartmill_core/signal/revolution_window.h"

namespace smartmill {

/// Options of ChatterCriterion. Shares are shares of energy.
struct ChatterCriterionOptions {
  /// [1] Least share of chatter in the energy of the signal without its mean. Vibration without chatter
  /// (noise, tones, errors of the spindle angle) is weaker than the forced vibration by more than that.
  double energy_ratio = 0.1;
  double least_severity = 0.0;  ///< [unit of the signal] least RMS of chatter
  /// [1] Least share of the energy that alternates from tooth to tooth in a flip of an even number of teeth;
  /// 1: flips are not judged. Every other tooth leaves the cut, so that the share is far above that of
  /// runout.
  double alternation_ratio = 0.1;
  /// [1] Least energy of a flip over that at the spindle harmonics at which unequal teeth differ. A flip has
  /// none there; a lost tooth has about as much, in a slot sin(phi) cos(phi) over half a revolution: 1/32 at
  /// order 2 and at the odd orders together, and the resonances of tool and sensor shift the shares.
  double alternation_purity = 4.0;
  /// [Hz] Band of the sensor. Vibration below is drift, hum and rumble, above it hiss and converters; unless
  /// synchronous with the spindle it counts nowhere.
  double lowest_frequency = 0.0, highest_frequency = std::numeric_limits<double>::infinity();
  /// [1] Largest share of the second half of a window over the first in the remainder of a transient, which
  /// decays; chatter grows or persists.
  double decay = 0.7;
  /// [1] Least power of a line over the noise floor, the median of the lines around it. Noise exceeds it in
  /// one of 16,000 lines.
  double over_floor = 14.0;
  std::size_t floor_reach = 40;  ///< [lines] of the median to each side, wider than a main lobe by far
  /// [1] Largest power at a distance of `skirt_distance` lines over that of a line. Noise through a resonance
  /// is wider.
  double narrowness = 0.06;
  std::size_t skirt_distance = 6;  ///< [lines] beyond the main lobe of the window, five lines wide
  /// [1] Least power of a companion over that of its line; the teeth modulate by more, noise by less.
  double least_companion = 1e-2;
  double companion_error = 0.5;  ///< [lines] largest error of a distance, the resolution of a line
  int companion_passings = 4;    ///< [tooth passing frequencies] largest distance; those farther are weak
  /// [1] Least share of a family of lines in the remainder without a companion next to it: one tone outweighs
  /// everything else. Several tones of another machine or noise leave less to one of them.
  double dominance = 0.7;
  /// [1] Share of a family in the remainder above which it is the remainder: the noise in it is not
  /// subtracted before the comparison with energy_ratio.
  double whole = 0.85;
  /// [1] Relative error of the spindle angle of a window: lines that near to a spindle harmonic belong to it;
  /// 0: the spindle angle is measured.
  double speed_error = 0.0;
  /// [Hz] Lines that are known to be no chatter, e.g. aliased harmonics, within `companion_error`.
  std::vector<double> ignored;
  double over_background = 6.0;  ///< [1] least power of a line over the same line of the background
  std::vector<double> modes;     ///< [Hz] natural frequencies of tool and spindle; empty: unknown
  /// [1] Range of chatter frequencies around a mode; chatter is mostly above it.
  double below_mode = 0.06, above_mode = 0.15;
};

/// Evidence of one window.
struct ChatterEvidence {
  static constexpr double UNKNOWN = std::numeric_limits<double>::quiet_NaN();
  static constexpr double LARGEST_MARGIN = 3.0;  ///< [1] factor of 20: further energy says nothing more
  /// Why there is no chatter, the strongest reason last.
  enum class Reason { none, no_lines, decays, in_background, weak, single, far_from_modes };

  bool chatter = false;
  bool flip = false;  ///< period doubling of a tool with an even number of teeth
  Reason reason = Reason::no_lines;
  /// [1] Natural logarithm of the odds of the energy that decides (part over the rest) over those of its
  /// limit, the least where several have one: positive with chatter; at most 3 on either side, -3 without
  /// lines.
  double margin = -LARGEST_MARGIN;
  double energy_ratio = 0.0;  ///< [1] energy outside the spindle harmonics over total energy, without mean
  double severity = 0.0;      ///< [unit of the signal] RMS outside the spindle harmonics
  double alternation = 0.0;   ///< [1] energy that alternates from tooth to tooth over total energy
  double order = UNKNOWN;     ///< [1/revolution] of the chatter, else of the strongest line
  double synchronous = 0.0;   ///< [unit of the signal squared] mean square of the spindle harmonics
  std::size_t onset = 0;      ///< first revolution of the window after which none repeats
  // Of the family of chatter lines
  double line_power = 0.0;  ///< [unit of the signal squared] mean square of the strongest line
  double power = 0.0;       ///< [unit of the signal squared] mean square
  int companions = 0;       ///< lines in addition to the strongest
  bool modulated = false;   ///< a companion is one tooth passing frequency away
  /// Equal companions one revolution to both sides, none one tooth passing frequency away: as of a bearing.
  bool like_bearing = false;
  double over_floor = UNKNOWN;       ///< [1] power of the strongest line over the noise floor
  double over_background = UNKNOWN;  ///< [1] and over the background, if it is given
  double mode = UNKNOWN;             ///< [Hz] nearby mode
};

/// The one criterion of chatter, for forces, vibration and sound, live and recorded. Chatter is
/// - not synchronous with the spindle, and does not decay like a transient;
/// - a family of narrow lines at distances of whole revolutions, because the teeth sample the vibration
///   (Insperger, Stepan et al.: chatter frequencies of a time-periodic process; unequal teeth add multiples
///   of the spindle frequency). Noise has no lines; a tone of another machine has no companions, and is
///   present in the background, where that is known;
/// - near a mode with one of its lines, where the modes are known;
/// - strong compared with the forced vibration.
/// A flip (period doubling) of a tool with an even number of teeth repeats every revolution, as runout does,
/// and is distinguished by its size, and from a lost tooth by its orders: in a flip every second tooth cuts
/// alike. A tool with two teeth has the same orders in both cases; a lost tooth is then reported as chatter.
class ChatterCriterion {
 public:
  explicit ChatterCriterion(const ChatterCriterionOptions& options) : options_(options) {}

  /// @param period [s] of a revolution @param background power of each line of the remainder while nothing is
  /// cut, as RevolutionWindow::power(); empty: unknown
  ChatterEvidence judge(const RevolutionWindow& window, double period,
                        const std::vector<double>& background = {}) const;

 private:
  struct Line {
    double position = 0.0;                              // [lines]
    double power = 0.0;                                 // mean square
    double over_floor = 0.0;                            // [1]
    double over_background = ChatterEvidence::UNKNOWN;  // [1]
  };
  struct Family {
    Line strongest;
    double power = 0.0;  // mean square of all
    int companions = 0;
    int one_revolution = 0;           // companions one revolution away
    bool one_passing = false;         // a companion one tooth passing frequency away
    double below = 0.0, above = 0.0;  // mean squares of the lines one revolution below and above
    double mode = ChatterEvidence::UNKNOWN;
    double margin = -ChatterEvidence::LARGEST_MARGIN;  // [1]
    /// By the teeth: two unrelated tones are one revolution apart by chance more often than three.
    bool isModulated() const { return one_passing || one_revolution >= 2; }
    /// A defect of a bearing is modulated by the revolution, the same on both sides; teeth also add lines one
    /// tooth passing frequency away.
    bool isLikeBearing() const {
      constexpr double SAME = 4.0;  // [1] power, 6 dB
      return !one_passing && std::min(below, above) > 0.0 &&
             std::max(below, above) < SAME * std::min(below, above);
    }
  };
  /// Mean squares within the band, on the scale of the spectrum.
  struct Energies {
    double total, remainder;
  };
  std::vector<Line> lines(const RevolutionWindow& window, double period,
                          const std::vector<double>& background, ChatterEvidence::Reason& reason) const;
  Family familyOf(const Line& line, const std::vector<Line>& lines, const RevolutionWindow& window,
                  double period) const;
  Family strongestFamily(const RevolutionWindow& window, double period, const std::vector<double>& background,
                         const Energies& energies, ChatterEvidence::Reason& reason) const;
  /// [1] Energy of the second half of the window over the least that of a vibration that persists.
  double persistence(const RevolutionWindow& window) const;
  /// Of the remainder.
  double powerInBand(const RevolutionWindow& window, double period) const;
  double modeNear(double frequency) const;  // [Hz]

  ChatterCriterionOptions options_;
};

}  // namespace smartmill
