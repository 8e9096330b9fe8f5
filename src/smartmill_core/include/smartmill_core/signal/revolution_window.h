#pragma once

#include <cstddef>
#include <vector>

namespace smartmill {

/// Energies of a window of whole spindle revolutions, sampled in even steps of the spindle angle and summed
/// over the channels. The synchronous part (teeth, runout) is the mean over the revolutions at each angle;
/// the remainder is chatter, noise or a tone of another machine.
///
/// In an unsteady cut the forced vibration changes with the engagement: lines next to the harmonics. What
/// changes there is part of the forced vibration and not of the remainder (cyclostationary signal, Antoni
/// 2009): at each angle of a tooth passing period all changes of up to half a cycle in a revolution, and at
/// each angle of a revolution, for teeth that differ, those of up to one cycle in the window. A vibration
/// within half a spindle frequency of a tooth passing harmonic, or within a line of a spindle harmonic,
/// therefore does not show in the remainder.
class RevolutionWindow {
 public:
  enum class Cut { steady, unsteady };

  /// @param bins samples in a revolution @param turns revolutions, 2 or more @param teeth of the tool; 0:
  /// unknown. In an unsteady cut two or more, evenly spaced, and a divisor of bins.
  RevolutionWindow(std::size_t bins, std::size_t turns, int teeth, Cut cut = Cut::steady);

  /// @param channel bins x turns samples
  void add(std::vector<double> channel);
  /// Samples a series at a constant speed. @param start [samples] at least 1 @param revolution [samples]; the
  /// window ends two samples or more before the series
  void add(const std::vector<double>& series, double start, double revolution);

  std::size_t bins() const { return bins_; }
  std::size_t turns() const { return turns_; }
  int teeth() const { return teeth_; }
  double total() const { return total_; }          ///< variance
  double remainder() const { return remainder_; }  ///< mean square of the remainder
  /// Mean square of the remainder in each revolution.
  const std::vector<double>& remainderOfTurn() const { return remainder_of_turn_; }
  /// Mean square of the remainder in each line of its spectrum (Hann window); turns() lines are one
  /// revolution.
  const std::vector<double>& power() const { return power_; }
  /// Mean square of the synchronous part at the orders of a flip: odd multiples of half the number of teeth;
  /// 0 for an odd number of teeth.
  double alternating() const { return alternating_; }
  /// And at the orders that are no multiple of half the number of teeth: teeth that differ from each other,
  /// by runout, uneven pitch or a lost tooth. 0 for two teeth, whose orders are all multiples, and for an odd
  /// number.
  double unequal() const { return unequal_; }
  double strongestFlipOrder() const;  ///< [1/revolution]
  /// Mean square of the synchronous part at each order from 0; that of order 0 is not defined.
  const std::vector<double>& ofOrder() const { return of_order_; }

 private:
  void addOrders(const std::vector<double>& repeated);

  std::size_t bins_, turns_;
  Cut cut_;
  std::size_t half_;
  int teeth_;
  double total_ = 0.0, remainder_ = 0.0, alternating_ = 0.0, unequal_ = 0.0;
  std::vector<double> remainder_of_turn_, taper_, of_order_, power_;
};

}  // namespace smartmill
