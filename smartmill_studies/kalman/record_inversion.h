#pragma once

#include <array>
#include <vector>

#include "smartmill_kalman/sensor/transfer_matrix.h"

namespace smartmill::kalman {

/// What the sensor would have shown without its dynamics. Where a rigid body on its feet explains the taps
/// (six channels; the lines' standard deviations say so), its inverse, told by all lines together; otherwise
/// (G' G + floor)^-1 G' at every line, floor what the matrix is not known to. A record of any length, no
/// latency.
/// @param measured one record a channel [N, N m] @param bandwidth [Hz] full to there, nothing beyond 1.15
/// times
/// @return applied force (and moment) of every channel. @throws Error on another number of channels or rate,
/// or when the matrix is only a band.
std::vector<std::vector<double>> invertRecord(const TransferMatrix& matrix,
                                              const std::vector<std::vector<double>>& measured,
                                              double sample_rate, double bandwidth);

/// Point at height z above the sensor's origin at which a single force gives this moment, M = r x F.
/// @return x, y [m]; NaN where the force along z cannot tell. @param force [N] @param moment [N m] @param z
/// [m]
std::array<double, 2> pointOfApplication(const std::array<double, 3>& force,
                                         const std::array<double, 3>& moment, double z);

}  // namespace smartmill::kalman
