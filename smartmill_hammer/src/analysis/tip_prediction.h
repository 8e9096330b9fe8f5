#pragma once

#include "tip_fit.h"

namespace smartmill::hammer {

/// The modes at the tip that a fit predicts, with standard deviations from the covariance of the unknowns.
TipCorrection correctionOf(const TipProblem& problem, const TipFit& fit);

}  // namespace smartmill::hammer
