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
#include "smartmill_discrepancy/data/dataset.h"
#include "smartmill_discrepancy/data/phase.h"
#include "smartmill_discrepancy/gap/whitening.h"
#include "smartmill_sim/twin/cut_traces.h"
#include "smartmill_sim/twin/twin.h"

namespace smartmill::discrepancy {

/// Where a channel of a test stands in a vector over the campaign.
struct Block {
  std::size_t test = 0;
  std::string channel;
  std::size_t offset = 0;
  std::size_t size = 0;
  double noise = 0.0;               ///< [unit of the channel]
  const SlowMeans* slow = nullptr;  ///< values are these means, not the record's samples
  bool judged = true;   ///< false: of a cut that chatters, which is fitted but takes no part in gaps
  double counts = 0.0;  ///< [samples] that count
};

/// What a model says of each block, over its noise. Where nothing that a test knows of has changed, models
/// share its blocks.
using SimulatedBlocks = std::vector<std::shared_ptr<const std::vector<double>>>;

/// Simulates tests of a campaign for many models at once. Vectors over the campaign hold all channels of the
/// chosen tests one after the other, each over its noise.
class TwinRunner {
 public:
  /// @param tests indices into data.tests, in the order of the vectors
  /// @param data must outlive this. @param threads >= 1. @param substeps of the twin a sample
  TwinRunner(const Dataset& data, std::vector<std::size_t> tests, int threads, int substeps);

  const std::vector<Block>& blocks() const { return blocks_; }
  const std::vector<std::size_t>& tests() const { return tests_; }
  std::size_t size() const { return size_; }
  double counts() const;  ///< [samples] that count: less than size() where some are trusted less
  const Dataset& data() const { return data_; }

  /// The records, whitened as what simulates them is.
  const std::vector<double>& measured() const { return whitened_.empty() ? measured_ : whitened_; }

  /// From here on everything over the campaign is seen through these filters, one a block, or none at all:
  /// samples of what is left then count once each.
  void setWhitening(std::vector<Whitening> of_blocks);

  int threads() const { return threads_; }

  /// Makes simulate() of the reference model give exactly this; what other models differ from it stays as it
  /// is. Takes the error of few substeps out, which is nearly alike for models nearby.
  void correctTo(const MachineModel& reference, const std::vector<double>& exact);

  /// Phases, speeds and entries of the dataset's records are others now; until then those of the last call
  /// stand.
  void readPhases();

  /// Which tests are guided by themselves, and how far they are trusted, is told otherwise now.
  void readGuidance();

  /// Whether tools with modes are guided by the displacement that cuts' records show, see SimulationOptions.
  void setGuided(bool guided);

  /// Steps of the twin a sample and slices of a tool's corner from here on; all slices until then.
  void setFineness(int substeps, int corner_slices);
  int substeps() const { return substeps_; }

  /// What each model says. @throws Error of the twin.
  std::vector<std::vector<double>> simulate(const std::vector<MachineModel>& models) const;
  std::vector<double> simulate(const MachineModel& model) const;

  /// The same in blocks, without what correctTo() adds to each model alike.
  std::vector<SimulatedBlocks> simulateBlocks(const std::vector<MachineModel>& models) const;
  /// What a model says when one of the chosen tests lies elsewhere, beside what it says of all of them.
  SimulatedBlocks turned(const MachineModel& model, const SimulatedBlocks& base, std::size_t chosen,
                         const Turn& by) const;
  /// Of one block, with it: (simulated - measured) over noise.
  void compare(const SimulatedBlocks& simulated, std::size_t block, double* apart) const;
  /// In one vector, with it.
  std::vector<double> joined(const SimulatedBlocks& blocks) const;

  std::size_t simulations() const { return simulations_; }  ///< tests simulated so far

 private:
  // What a channel shows, by the values that it depends on, the newest first.
  using Shown = std::deque<std::pair<std::vector<double>, std::shared_ptr<const std::vector<double>>>>;
  // Of one test: what the twin needs of its record, its last results channel by channel, and what the tool
  // did in it. A tap says nothing of a cutting coefficient, a sensor's mode nothing of the cut nor of another
  // axis: what a fit moves leaves much as it was.
  struct Kept {
    Record record;
    CampaignTest test;
    double phase = 0.0, early_entry = 0.0;
    bool guided = false;
    std::mutex mutex;
    std::vector<Shown> shown;  // of each channel
    std::unique_ptr<sim::CutTraces> traces;

    void forget();
  };
  bool readTrust(std::size_t block);
  void whitenRecords();
  bool guides(std::size_t chosen) const { return guided_ || kept_[chosen].guided; }
  SimulatedBlocks simulateOne(const MachineModel& model, std::size_t chosen) const;
  SimulatedBlocks blocksOf(const MachineModel& model, std::size_t chosen, const CampaignTest& test,
                           const sim::SimulationOptions& options) const;

  const Dataset& data_;
  std::vector<std::size_t> tests_;
  mutable std::deque<Kept> kept_;
  int threads_, substeps_, corner_slices_ = CORNER_SLICES;
  bool guided_ = false;
  std::vector<Block> blocks_;
  std::vector<std::size_t> first_block_;  // of each chosen test; one more at the end
  std::size_t size_ = 0;
  std::vector<double> measured_;
  std::vector<Whitening> whitening_;  // of each block, or none
  std::vector<double> whitened_;      // the records through them; empty: as they are
  std::vector<double> correction_;
  mutable std::atomic<std::size_t> simulations_{0};
};

/// Sum of squares over noise that a simulation leaves of the records.
double squaresLeft(const TwinRunner& runner, const std::vector<double>& simulated);

/// Calls job(0) .. job(count - 1), spread over threads; within such a job, one after the other. @throws the
/// first exception of a job, by index.
void runParallel(std::size_t count, int threads, const std::function<void(std::size_t)>& job);

}  // namespace smartmill::discrepancy
