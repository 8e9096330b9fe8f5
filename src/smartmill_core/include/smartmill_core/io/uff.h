#pragma once

#include <complex>
#include <string>
#include <vector>

namespace smartmill {

/// Kinds of functions and of data in a universal file, dataset 58 (SDRC I-DEAS, Test Universal File Format).
namespace uff {
constexpr int TIME_RESPONSE = 1, FREQUENCY_RESPONSE = 4, COHERENCE = 6;
constexpr int DISPLACEMENT = 8, REACTION_FORCE = 9, VELOCITY = 11, ACCELERATION = 12, EXCITATION_FORCE = 13,
              TIME = 17, FREQUENCY = 18;
}  // namespace uff

/// One function of a universal file: dataset 58 (text) or 58b (binary values).
struct UffFunction {
  int type = 0;
  std::string name;  ///< first line of the header
  int response_node = 0, response_direction = 0, reference_node = 0, reference_direction = 0;
  int numerator = 0, denominator = 0;       ///< kinds of data of the values' numerator and denominator
  std::string unit;                         ///< as written next to the values
  std::vector<double> abscissa;             ///< [s] or [Hz]
  std::vector<std::complex<double>> value;  ///< as in the file; real functions have no imaginary part
};

/// Whether the file begins like a universal file.
bool isUff(const std::string& file);

/// All functions of type 58; other datasets are skipped. Text of any width with E or D exponents; binary
/// little and big endian, single and double precision. @throws Error "FILE: dataset N: what".
std::vector<UffFunction> readUff(const std::string& file);

/// Evenly or unevenly spaced, double precision. @throws Error.
void writeUff(const std::vector<UffFunction>& functions, const std::string& file, bool binary);

}  // namespace smartmill
