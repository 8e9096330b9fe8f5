#pragma once

#include <cstddef>
#include <functional>

#include "smartmill_discrepancy/search/screening.h"
#include "smartmill_discrepancy/search/search.h"

namespace smartmill::discrepancy {

/// Fits a screened hypothesis and returns it as a candidate with gain and cost.
/// @param now fit at the start of the round @param fit runs the fit; the hypothesis is its last member
/// @param tried receives the fit
Candidate fitCandidate(const Fitter& fitter, const PredictedGain& predicted, std::size_t round,
                       const FitResult& now, const std::function<FitResult()>& fit, FitResult* tried);

/// A fit without the members that it no longer needs, since others explain the same; one member remains.
/// @param tangents near the fit @param keep_newest whether the last member stays
FitResult withoutUnneeded(const Fitter& fitter, FitResult fit, const NominalTangents& tangents,
                          const SearchOptions& options, bool keep_newest);

/// Refits alternatives with fewer values than the member that they compete with, so that the later comparison
/// starts from their best values. Guided simulations have a smooth cost; free ones near a tool's stability
/// limit do not.
/// @param now current fit @param tangents at its state @param candidates receives the values
void refitSimplerAlternatives(const Fitter& fitter, const FitResult& now, const NominalTangents& tangents,
                              const SearchOptions& options, std::vector<Candidate>* candidates);

/// Fits a state with all values free and exact simulation; measures the contribution of each member and of
/// its best alternatives.
/// @param result candidates are read; best, contribution, is_needed, without_member and alternatives are
/// written
/// @return false: the twin gives no finite values, best is unchanged
bool refine(Workbench& bench, const FitState& state, const SearchOptions& options, SearchResult* result);

/// Covariance of a refined fit for a residual that is not white (Fitter::sandwichCovariance()).
Eigen::MatrixXd robustCovariance(Workbench& bench, const FitResult& best);

/// Sets an insignificant path share to zero (NominalFreedom::writeStdDevs()) and moves the other values to
/// their conditional optimum.
/// @param of_fit covariance of the fit itself; best->covariance is the robust one
void dropInsignificantPathShare(const MachineModel& nominal, const NominalFreedom& freedom,
                                const Eigen::MatrixXd& of_fit, FitResult* best);

}  // namespace smartmill::discrepancy
