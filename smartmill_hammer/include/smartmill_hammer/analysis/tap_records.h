#pragma once

#include <string>
#include <vector>

#include "smartmill_core/modal/impact_analysis.h"
#include "smartmill_core/modal/modal_fit.h"
#include "smartmill_core/signal/frequency_response.h"

namespace smartmill {
namespace hammer {

/// Files that hold hammer tests.
enum class TapFormat {
  automatic,  ///< told by content
  bag,        ///< a recorded session
  csv,        ///< name[unit] columns: time[s], hammer[N], acceleration[m/s2] or displacement[m]
  text,       ///< three columns without header: time [s], force [N], acceleration [m/s2]
  frf         ///< three columns without header: frequency [Hz], Re, Im of the receptance [m/N]
};

/// @throws Error naming the file when it is none of these.
TapFormat detectFormat(const std::string& file);

struct TapRecord {
  std::string file;
  Hit hit;                    ///< response in m or m/s2
  bool acceleration = false;  ///< of the response
};

/// @throws Error naming file and what is missing or wrong.
TapRecord readTapCsv(const std::string& file);
TapRecord readTapText(const std::string& file);
FrequencyResponse readFrfText(const std::string& file);

/// H1 of several hits of one point.
struct TapFrf {
  FrequencyResponse
      measured;  ///< accelerance [m/s2/N] where acceleration was measured, otherwise the receptance
  FrequencyResponse receptance;    ///< [m/N]
  std::vector<std::string> notes;  ///< hits thrown away and why, one line each
};

/// @throws Error when no hit is left or the records differ in length, rate or kind of response.
TapFrf averageTaps(const std::vector<TapRecord>& taps, const HitLimits& limits, double exponential_time);

/// One row of what people compare: a mode and the measured receptance at its frequency.
struct ModeReading {
  Mode mode;
  std::complex<double> receptance;  ///< [m/N] measured, between lines interpolated
};
/// Modes seen one by one: a peak of |Im| of the receptance, and one mode with a constant rest fitted to the
/// lines above its half-power height. Robust where modes are close or the model is not complete; lowest
/// frequency first.
/// @param share least prominence, of the largest peak @param most strongest peaks kept
std::vector<ModeReading> peakModes(const FrequencyResponse& receptance, double low, double high, double share,
                                   std::size_t most);

/// True when Im of the receptance is negative nearly everywhere in the band: hit and response at one point.
bool looksDirect(const FrequencyResponse& receptance, double low, double high);

std::vector<ModeReading> readModes(const ModalModel& model, const FrequencyResponse& receptance);

/// Columns frequency[Hz],real[..],imag[..],coherence[1],std_dev[..],fit_real[..],fit_imag[..]. @throws Error.
void writeFrfCsv(const FrequencyResponse& frf, const ModalModel& fit, const std::string& file);

/// Columns frequency[Hz],damping_ratio[1],stiffness[N/um], each with _std. @throws Error.
void writeModesCsv(const ModalModel& model, const std::string& file);

/// Picture of measured and fitted receptance (and coherence) by gnuplot, from the file of writeFrfCsv.
/// @throws Error when gnuplot fails.
void plotFrf(const std::string& csv_file, const std::string& png_file, const std::string& title, double low,
             double high, bool coherence);

}  // namespace hammer
}  // namespace smartmill
