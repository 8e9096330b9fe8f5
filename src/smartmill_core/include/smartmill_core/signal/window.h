#pragma once

#include <cstddef>
#include <vector>

namespace smartmill {

/// Hann window of n samples (periodic form).
std::vector<double> hannWindow(std::size_t n);

/// Four-term Blackman-Harris window, side lobes below -92 dB (Harris 1978). @param turn [rad] 0..2 pi over
/// the window
double blackmanHarris(double turn);

/// Force window of Dunwoody eq. 4.17..4.19: one during the contact, cosine tapers on both sides, zero
/// elsewhere. The shoulders are the 10 % points around the largest force. Same length as force [N].
/// @throws Error when there is no positive peak.
std::vector<double> impactWindow(const std::vector<double>& force);

/// Whether the force outside the window around the main peak exceeds this share of the peak: a double hit.
bool hasSecondHit(const std::vector<double>& force, double share);

}  // namespace smartmill
