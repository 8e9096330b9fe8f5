#pragma once

#include <cstddef>
#include <functional>

#include "smartmill_discrepancy/search/screening.h"
#include "smartmill_discrepancy/search/search.h"

namespace smartmill::discrepancy {

/// The rung of a promise, with what its fit took.
/// @param now where the round stands @param fit that is run; its newest member is the promised one
/// @param tried receives the fit
Rung rungOf(const Fitter& fitter, const Promise& promise, std::size_t round, const Fit& now,
            const std::function<Fit()>& fit, Fit* tried);

/// Rivals of fewer values than the member that they came near to are followed to where they fit best beside
/// the others, so that the comparison begins there: where a search is guided its squares are smooth, those of
/// a free simulation near a tool's limit are not.
/// @param now where the search stands @param tangents there @param ladder receives the values
void followSimpler(const Fitter& fitter, const Fit& now, const NominalTangents& tangents,
                   std::vector<Rung>* ladder);

/// Fits a state with every value free and simulated exactly, and measures what each member contributes and
/// how its best rivals do in its place.
/// @param result its ladder tells the rivals; best, contribution, needed and rivals are written
/// @return false: the twin gives no numbers there, best is as it was
bool refine(Workbench& bench, const FitState& state, const SearchOptions& options, SearchResult* result);

/// Covariance of the values of a refined fit as far as what is left lets one know them
/// (Fitter::sandwichCovariance()).
Eigen::MatrixXd settledCovariance(Workbench& bench, const Fit& best);

/// A share of the teeth's path that is no more than three of its deviations is left out
/// (NominalFreedom::writeStdDevs()): the fit moves to where it is best without. @param of_fit covariance with
/// which it was fitted; the fit holds the settled one
void leaveOutUntoldPath(const MachineModel& nominal, const NominalFreedom& freedom,
                        const Eigen::MatrixXd& of_fit, Fit* best);

}  // namespace smartmill::discrepancy
