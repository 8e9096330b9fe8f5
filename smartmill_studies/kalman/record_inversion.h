#pragma once

#include <array>
#include <vector>

#include "smartmill_kalman/sensor/transfer_matrix.h"

namespace smartmill::kalman {

/// Compensates a record of any length for the dynamics of the sensor, without latency. If a rigid body on its
/// feet explains the taps (six channels; within the standard deviations of the lines), its inverse is fitted
/// to all lines; otherwise (G' G + floor)^-1 G' at every line, with the variance of the matrix as floor.
/// @param measured one record per channel [N, N m] @param bandwidth [Hz] end of the pass band; the stop band
/// begins at 1.15 times it
/// @return applied force (and moment) of every channel. @throws Error on another number of channels or rate,
/// or when the matrix is only a band.
std::vector<std::vector<double>> invertRecord(const TransferMatrix& matrix,
                                              const std::vector<std::vector<double>>& measured,
                                              double sample_rate, double bandwidth);

/// Point at height z above the sensor's origin at which a single force gives this moment, M = r x F.
/// @return x, y [m]; NaN where the force along z is too small. @param force [N] @param moment [N m] @param z
/// [m]
std::array<double, 2> pointOfApplication(const std::array<double, 3>& force,
                                         const std::array<double, 3>& moment, double z);

}  // namespace smartmill::kalman
