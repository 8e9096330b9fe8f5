#pragma once

#include <map>
#include <memory>
#include <optional>
#include <vector>

#include <Eigen/Core>

#include "smartmill_discrepancy/fit/fit.h"
#include "smartmill_discrepancy/search/standing.h"

namespace smartmill::discrepancy {

/// What a hypothesis promises, from its tangents beside those of the nominal values and of the effects found
/// so far.
struct Promise {
  const Hypothesis* hypothesis = nullptr;
  double gain = 0.0;   ///< chi2 that it takes away in linear approximation
  bool rough = false;  ///< by what it did when it was simulated last; nothing but the gain is known
  /// [1] Share of what it does that nominal values and members cannot stand for: where it is small, a gain
  /// says that they are off.
  double apart = 1.0;
  std::vector<double> start;  ///< coordinates to start a fit from
  std::vector<double>
      null;  ///< the point without effect that the start was reached from; empty: the start stands
  /// What it would change beside all else that moves with it, and what would be left without it, laid out as
  /// the runner's vectors; nullptr: too little to tell.
  std::shared_ptr<const Eigen::VectorXd> change, left_without;
  AskedTest stated;  ///< what the stated nominal values say of it, its variance left open
};

/// What hypotheses did when they were simulated last, thinned out: what one does changes little from one
/// state to the next, so that one that comes nowhere near to what is due need not be simulated again.
struct ScreeningMemory {
  std::map<const Hypothesis*, std::vector<Eigen::MatrixXf>> did;  ///< of each probe
  /// The most that a hypothesis may promise by what parts of the same records said: for the next screening.
  std::map<const Hypothesis*, double> at_most;

  void clear() {
    did.clear();
    at_most.clear();
  }
};

/// Score test of each hypothesis at a fitted state. Best first; hypotheses without any trace in the data come
/// last.
/// @param tangents of the nominal values at the state
/// Cancelled, it ends with those that it has come to.
/// @param tried simulated one by one or in groups; may hold effects that are members already: those are
/// passed over
/// @param due gain below which a promise is of no use @param memory of the same runner and tried; those that
/// it says promise far less have a rough gain and no start
std::vector<Promise> screen(const Fitter& fitter, const Fit& now, const NominalTangents& tangents,
                            const std::vector<Hypothesis>& tried, double due, ScreeningMemory* memory);

/// Simulates those that were only remembered, where they promise this much.
void screenRough(const Fitter& fitter, const Fit& now, const NominalTangents& tangents, double least,
                 ScreeningMemory* memory, std::vector<Promise>* promises);

/// Tangents of these members' values, one member after the other.
/// @param base receives what the state itself says
BlockColumns memberTangents(const Fitter& fitter, const FitState& state,
                            const std::vector<std::size_t>& members, SimulatedBlocks* base);

/// What the fit tests would ask for of what is promised: as sure as a fit of it would be.
AskedShare fittedShare(const Fitter& fitter, const Promise& promise);

/// Where a hypothesis does to the radii of the teeth what a member does, as nearly as it can: runout in the
/// place of radii that were fitted one by one. No value: one of both changes none.
std::optional<std::vector<double>> inPlaceOf(const Fitter& fitter, const Member& member,
                                             const Hypothesis& hypothesis);

/// The promise is linear: of shorter ways from the null point to its start the one that fits best, or one
/// that is given beside them.
std::vector<double> bestStart(const Fitter& fitter, const Fit& now, const Promise& promise,
                              const std::optional<std::vector<double>>& other = {});

}  // namespace smartmill::discrepancy
