#pragma once

#include <cstddef>
#include <vector>

namespace smartmill {

/// Where a response that rings freely does something that its own past does not tell.
struct FreeDecayBreak {
  std::size_t sample = 0;  ///< 0: nowhere
  double size = 0.0;       ///< [unit of the response] unforeseen there
  bool sudden = false;     ///< one sample, not a stretch
};

/// Free ringing of any modes is a sum of decaying sines, which a linear prediction from the last samples
/// foretells to its noise. The record is seen at its own rate and averaged over 4 and 16 samples, where slow
/// motions show. @param from first sample after the contact @param noise of a sample
FreeDecayBreak freeDecayBreak(const std::vector<double>& response, std::size_t from, double noise);

/// How much more the samples begin .. end hold that the ringing before them does not foretell than that
/// ringing itself did: near 1 where modes beat, more where something else moves. 0: too little before.
double unforeseenRise(const std::vector<double>& response, std::size_t from, std::size_t begin,
                      std::size_t end, double noise);

}  // namespace smartmill
