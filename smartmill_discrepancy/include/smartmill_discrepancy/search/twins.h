#pragma once

#include <array>
#include <functional>

#include "smartmill_discrepancy/data/dataset.h"
#include "smartmill_discrepancy/gap/twin_runner.h"

namespace smartmill::discrepancy {

/// Fineness of the quick twin.
struct QuickTwinOptions {
  int slices = 4;  ///< of a tool's corner: the correction to the exact twin covers the rest
  /// Steps per period of a tool mode for the unguided twin: with fewer its stability limit is wrong and
  /// misleads the fit.
  double steps_per_period = 12.0;
  double max_free_substeps = 2.0;  ///< of the unguided twin: more take the time of the exact twin
};

struct WorkbenchOptions {
  int threads = 2;
  int screening_substeps = 1;  ///< increased for unguided tools with modes
  int final_substeps = EXACT_SUBSTEPS;
  std::function<bool()> cancelled;  ///< polled; true ends every fit at its current step
  QuickTwinOptions quick = {};
};

/// The twins of a campaign with the records that they share: a quick and an exact twin of the fitted tests,
/// the exact one guided, and an exact one of the held-out tests.
class Twins {
 public:
  Twins(const Dataset& data, const WorkbenchOptions& options);
  Twins(const Twins&) = delete;
  Twins& operator=(const Twins&) = delete;

  Dataset data;  ///< records without spindle angle are aligned again as the model improves
  TwinRunner quick, exact, guided, heldout;

  std::array<TwinRunner*, 4> all() { return {{&quick, &exact, &guided, &heldout}}; }
  /// Exact twin of the fitted tests, guided if the fits are.
  const TwinRunner& fitted() const { return is_guided_ ? guided : exact; }

  bool isGuided() const { return is_guided_; }
  /// Guides the quick and the held-out twin from now on.
  void setGuided(bool is_guided);
  /// Reads guidance and weights of the records again.
  void readGuidance();

 private:
  int freeSubsteps() const;

  WorkbenchOptions options_;
  bool is_guided_ = false;
};

}  // namespace smartmill::discrepancy
