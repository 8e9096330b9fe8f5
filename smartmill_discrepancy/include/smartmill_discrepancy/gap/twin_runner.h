#pragma once

#include <atomic>
#include <cstddef>
#include <deque>
#include <functional>
#include <memory>
#include <mutex>
#include <string>
#include <utility>
#include <vector>

#include "smartmill_core/campaign/record.h"
#include "smartmill_core/model/machine_model.h"
#include "smartmill_discrepancy/data/alignment.h"
#include "smartmill_discrepancy/data/dataset.h"
#include "smartmill_discrepancy/gap/whitening.h"
#include "smartmill_sim/twin/cut_traces.h"
#include "smartmill_sim/twin/twin.h"

namespace smartmill::discrepancy {

/// Position of one channel of a test in a vector over the campaign.
struct ChannelSpan {
  std::size_t test = 0;
  std::string channel;
  std::size_t offset = 0;
  std::size_t size = 0;
  double noise = 0.0;               ///< [unit of the channel]
  const SlowMeans* slow = nullptr;  ///< values are these means instead of the record's samples
  bool in_gap = true;               ///< false: a chattering cut, which is fitted but takes no part in gaps
  double effective_samples = 0.0;   ///< [samples] that count as independent
};

/// Simulated values over the noise, one vector per span. Models share the vectors of spans that their
/// differences do not affect.
using SimulatedChannels = std::vector<std::shared_ptr<const std::vector<double>>>;

/// Simulates tests of a campaign for many models at once. Vectors over the campaign hold all channels of the
/// chosen tests one after the other, each over its noise.
class TwinRunner {
 public:
  /// @param data must outlive this object @param tests indices into data.tests, in the order of the vectors
  /// @param threads >= 1 @param substeps of the twin per sample
  TwinRunner(const Dataset& data, std::vector<std::size_t> tests, int threads, int substeps);

  const std::vector<ChannelSpan>& spans() const { return spans_; }
  const std::vector<std::size_t>& tests() const { return tests_; }
  std::size_t size() const { return size_; }
  double effectiveSamples()
      const;  ///< [samples] that count as independent: less than size() if channels have reduced weights
  const Dataset& data() const { return data_; }

  /// The records, whitened like the simulations.
  const std::vector<double>& measured() const { return whitened_.empty() ? measured_ : whitened_; }

  /// Applies these filters, one per span or none at all, to everything from now on, so that residual samples
  /// are independent.
  void setWhitening(std::vector<Whitening> of_blocks);

  int threads() const { return threads_; }

  /// Makes simulate() of the reference model return exactly these values and keeps the differences of other
  /// models. It removes the error of coarse steps, which is similar for neighbouring models.
  void correctTo(const MachineModel& reference, const std::vector<double>& exact);

  /// Reads phases, speeds and entries of the dataset's records again.
  void readPhases();

  /// Reads guidance and weights of the tests again.
  void readGuidance();

  /// Whether tools with modes are guided by the recorded displacement of the tip, see SimulationOptions.
  void setGuided(bool guided);

  /// Sets the steps of the twin per sample and the slices of a tool's corner (initially all slices).
  void setFineness(int substeps, int corner_slices);
  int substeps() const { return substeps_; }

  /// Simulated values of each model. @throws Error of the twin.
  std::vector<std::vector<double>> simulate(const std::vector<MachineModel>& models) const;
  std::vector<double> simulate(const MachineModel& model) const;

  /// The same by span, without the correction of correctTo().
  std::vector<SimulatedChannels> simulateChannels(const std::vector<MachineModel>& models) const;
  /// Simulation with a changed alignment of one test.
  /// @param base simulation with the current alignment
  SimulatedChannels realigned(const MachineModel& model, const SimulatedChannels& base, std::size_t chosen,
                              const RecordAlignment& by) const;
  /// (simulated - measured) over noise of one span, with the correction of correctTo().
  void compare(const SimulatedChannels& simulated, std::size_t block, double* difference) const;
  /// All spans in one vector, with the correction of correctTo().
  std::vector<double> joined(const SimulatedChannels& blocks) const;

  std::size_t simulations() const { return simulations_; }  ///< tests simulated so far

 private:
  // Simulated values of a channel by the model values that affect it, the newest first.
  using ChannelCache = std::deque<std::pair<std::vector<double>, std::shared_ptr<const std::vector<double>>>>;
  // Cache of one test: its record for the twin, the last results by channel, and the traces of the cut. Most
  // model values affect few channels: a tap does not depend on the cutting coefficients, a sensor mode
  // affects one axis.
  struct TestCache {
    Record record;
    CampaignTest test;
    double phase = 0.0, early_entry = 0.0;
    bool guided = false;
    std::mutex mutex;
    std::vector<ChannelCache> channels;  // by channel
    std::unique_ptr<sim::CutTraces> traces;

    void clear();
  };
  bool readWeight(std::size_t block);
  void whitenRecords();
  bool guides(std::size_t chosen) const { return guided_ || caches_[chosen].guided; }
  SimulatedChannels simulateOne(const MachineModel& model, std::size_t chosen) const;
  SimulatedChannels channelsOf(const MachineModel& model, std::size_t chosen, const CampaignTest& test,
                               const sim::SimulationOptions& options) const;

  const Dataset& data_;
  std::vector<std::size_t> tests_;
  mutable std::deque<TestCache> caches_;
  int threads_, substeps_, corner_slices_ = CORNER_SLICES;
  bool guided_ = false;
  std::vector<ChannelSpan> spans_;
  std::vector<std::size_t> first_span_;  // by chosen test; one more at the end
  std::size_t size_ = 0;
  std::vector<double> measured_;
  std::vector<Whitening> whitening_;  // by span; empty: none
  std::vector<double> whitened_;      // the filtered records; empty: not filtered
  std::vector<double> correction_;
  mutable std::atomic<std::size_t> simulations_{0};
};

/// (measured - simulated) over noise.
std::vector<double> residualOf(const TwinRunner& runner, const MachineModel& model);

/// Sum of squares of the residual of a simulation.
double residualSquares(const TwinRunner& runner, const std::vector<double>& simulated);

/// Calls job(0) .. job(count - 1), distributed over threads; sequentially when called from a job.
/// @throws the first exception of a job, by index.
void runParallel(std::size_t count, int threads, const std::function<void(std::size_t)>& job);

}  // namespace smartmill::discrepancy
