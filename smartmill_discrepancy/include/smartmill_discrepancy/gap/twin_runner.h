#pragma once

#include <atomic>
#include <cstddef>
#include <deque>
#include <functional>
#include <vector>

#include "smartmill_core/model/machine_model.h"
#include "smartmill_discrepancy/data/alignment.h"
#include "smartmill_discrepancy/data/dataset.h"
#include "smartmill_discrepancy/gap/campaign_channels.h"
#include "smartmill_discrepancy/gap/test_twin.h"

namespace smartmill::discrepancy {

/// [1] of the signal: difference between two accurate simulations.
constexpr double TWIN_ACCURACY = 2e-4;
/// Of the exact twin per sample.
constexpr int EXACT_SUBSTEPS = 8;

/// Simulates tests of a campaign for many models at once. Vectors over the campaign have the layout of
/// CampaignChannels.
class TwinRunner {
 public:
  /// @param data must outlive this object @param tests indices into data.tests, in the order of the vectors
  /// @param threads >= 1 @param substeps of the twin per sample
  TwinRunner(const Dataset& data, std::vector<std::size_t> tests, int threads, int substeps);

  const Dataset& data() const { return data_; }
  const std::vector<std::size_t>& tests() const { return tests_; }
  int threads() const { return threads_; }
  const CampaignChannels& channels() const { return channels_; }
  const std::vector<ChannelSpan>& spans() const { return channels_.spans(); }
  std::size_t size() const { return channels_.size(); }
  /// The records, whitened like the simulations.
  const std::vector<double>& measured() const { return channels_.measured(); }

  /// Applies these filters, one per span or none at all, to everything from now on, so that residual samples
  /// are independent.
  void setWhitening(std::vector<Whitening> of_spans);

  /// Makes simulate() of the reference model return exactly these values and keeps the differences of other
  /// models. It removes the error of coarse steps, which is similar for neighbouring models.
  void correctTo(const MachineModel& reference, const std::vector<double>& exact);

  /// Reads phases, speeds and entries of the dataset's records again.
  void readPhases();
  /// Reads guidance and weights of the tests again.
  void readGuidance();

  const TwinSettings& settings() const { return settings_; }
  void set(const TwinSettings& settings);

  /// Simulated values of a model. @throws Error of the twin.
  std::vector<double> simulate(const MachineModel& model) const;

  /// The same of several models by span, without the correction of correctTo().
  std::vector<SimulatedChannels> simulateChannels(const std::vector<MachineModel>& models) const;
  /// Simulation with a changed alignment of one test.
  /// @param base simulation with the current alignment
  SimulatedChannels realigned(const MachineModel& model, const SimulatedChannels& base, std::size_t chosen,
                              const RecordAlignment& by) const;
  /// (simulated - measured) over noise of one span, with the correction of correctTo().
  void compare(const SimulatedChannels& simulated, std::size_t span, double* difference) const;
  /// All spans in one vector, with the correction of correctTo().
  std::vector<double> joined(const SimulatedChannels& simulated) const;

  std::size_t simulations() const { return simulations_; }  ///< tests simulated so far

 private:
  const Dataset& data_;
  std::vector<std::size_t> tests_;
  int threads_;
  TwinSettings settings_;
  CampaignChannels channels_;
  mutable std::deque<TestTwin> twins_;  // of the tests; they keep their last results
  std::vector<double> correction_;
  mutable std::atomic<std::size_t> simulations_{0};
};

/// (measured - simulated) over noise.
std::vector<double> residualOf(const TwinRunner& runner, const MachineModel& model);

/// Simulated values of each model. @throws Error of the twin.
std::vector<std::vector<double>> simulateAll(const TwinRunner& runner,
                                             const std::vector<MachineModel>& models);

/// Sum of squares of the residual of a simulation.
double residualSquares(const TwinRunner& runner, const std::vector<double>& simulated);

/// Calls job(0) .. job(count - 1), distributed over threads; sequentially when called from a job.
/// @throws the first exception of a job, by index.
void runParallel(std::size_t count, int threads, const std::function<void(std::size_t)>& job);

}  // namespace smartmill::discrepancy
