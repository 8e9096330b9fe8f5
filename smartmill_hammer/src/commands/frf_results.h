#pragma once

#include <string>
#include <vector>

#include "node/parameters.h"
#include "smartmill_core/modal/modal_estimate.h"
#include "smartmill_hammer/analysis/frf_files.h"
#include "smartmill_hammer/analysis/tap_records.h"

namespace smartmill::hammer {

/// The tool between its tip and a point struck above it [mm], with standard deviations.
struct TipOptions {
  double stickout = 0.0, stickout_std = 0.5, diameter = 0.0, fluted = 0.0, fluted_std = 1.0;
  double flute_ratio = 0.8, flute_ratio_std = 0.03, struck = 15.0, read = 0.0;
  std::string material = "carbide";
};

struct FrfOptions {
  std::vector<std::string> inputs;
  std::string out = "frf", format = "auto", model, average = "h1";
  NodeParameters parameters;
  ChannelNames channels;
  double low = 0.0, high = 0.0, weak_force = 0.0;
  int modes = 0, max_modes = 100;
  bool real_modes = false, binary = false, no_picture = false;
  TipOptions tip;
};

/// Table of modes. @param receptance prints the stiffness instead of the gain
void printModes(const std::vector<EstimatedMode>& modes, bool receptance);

/// Proven modes, then doubtful ones.
void printEstimate(const ModalEstimate& estimate, bool receptance);

/// Relative standard deviation of the average over the band, and the hits that the required one needs.
void printUncertainty(const FrfOptions& options, const FrequencyResponse& frf);

/// Writes FRFs, modes and plots to the folder of results. @param suffix of the file names
void writeResults(const FrfOptions& options, const std::string& suffix, const std::vector<NamedFrf>& frfs,
                  const ModalEstimate& estimate);

/// Writes the direct FRF at the tip: frf_tip.csv, modes_tip.yaml.
void writeTip(const FrfOptions& options, const FrequencyResponse& frf, const ModalEstimate& estimate);

}  // namespace smartmill::hammer
