#pragma once

#include <cstddef>
#include <vector>

namespace smartmill {

/// Energies of a window of whole spindle revolutions, sampled in even steps of the spindle angle and summed
/// over the channels. The synchronous part (teeth, runout) is the mean over the revolutions at each angle;
/// the remainder is chatter, noise or a tone of another machine.
class RevolutionWindow {
 public:
  /// @param bins samples in a revolution @param turns revolutions, 2 or more @param teeth of the tool; 0:
  /// unknown
  RevolutionWindow(std::size_t bins, std::size_t turns, int teeth);

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

  std::size_t bins_, turns_, half_;
  int teeth_;
  double total_ = 0.0, remainder_ = 0.0, alternating_ = 0.0, unequal_ = 0.0;
  std::vector<double> remainder_of_turn_, taper_, of_order_, power_;
};

}  // namespace smartmill
