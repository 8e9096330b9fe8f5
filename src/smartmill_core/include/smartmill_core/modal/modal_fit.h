#pragma once

#include <vector>

#include <Eigen/Core>

#include "smartmill_core/modal/modal_model.h"
#include "smartmill_core/signal/frequency_response.h"

namespace smartmill {

struct ModalFitOptions {
  double low = 0.0;   ///< [Hz] band of the fit
  double high = 0.0;  ///< [Hz]
  int modes = 0;      ///< 0: all significant ones, up to max_modes
  int max_modes = 8;
  bool unit_static_gain = false;  ///< force sensor: direct = 1 - sum of gains (Dunwoody eq. 5.6, with K_k /
                                  ///< w_k^2); otherwise the direct share is free
  /// Drive point: gains are positive, so that no mode with a negative gain is fitted.
  bool positive_gains = false;
};

struct ModalFit {
  ModalModel model;             ///< with standard deviations, finite, lowest frequency first
  std::vector<Mode> doubts;     ///< not significant; not part of the model
  Eigen::MatrixXd covariance;   ///< of (frequency, damping_ratio, gain) of each mode, then direct
  double relative_error = 0.0;  ///< [1] norm of (fit - measured) over norm of measured in the band
  double reduced_chi2 = 0.0;    ///< [1] with the FRF's std_dev; NaN without it
};

/// Real modes of an FRF: the significant modes of estimateModes(), fitted together over the band with the
/// constraints of the options. Lines are weighted by their standard deviation where it is known. Standard
/// deviations follow from the Jacobian, scaled up by sqrt(reduced_chi2) when that exceeds one.
/// @throws Error when the band has too few lines, no mode is significant, or the solver does not converge.
ModalFit fitModes(const FrequencyResponse& frf, const ModalFitOptions& options);

}  // namespace smartmill
