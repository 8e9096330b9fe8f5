#pragma once

#include <array>
#include <string>
#include <vector>

#include "smartmill_core/campaign/campaign.h"
#include "smartmill_core/campaign/record.h"
#include "smartmill_core/modal/modal_fit.h"
#include "smartmill_kalman/compensation/record_compensation.h"
#include "smartmill_kalman/filter/coupled_filter.h"

namespace smartmill::kalman {

/// Band and size of the modal fit of a force sensor's taps.
struct SensorFitParameters {
  double low = 100.0;    ///< [Hz]
  double high = 5000.0;  ///< [Hz] above low
  int max_modes = 4;     ///< 1..20, chosen by evidence
  /// @throws Error naming key and value.
  void validate() const;
};

/// H1 over all hits [1], hammer force windowed, with standard deviations.
FrequencyResponse averagedFrf(const std::vector<std::vector<double>>& hammer,
                              const std::vector<std::vector<double>>& response, double sample_rate);

/// Sensor model of one axis (static gain 1) from taps along it: H1 over all hits, hammer force windowed
/// (Dunwoody ch. 5). A response with negative static gain is negated.
/// @param hammer, response [N] one vector a hit, all of one length @param sample_rate [Hz]
/// @throws Error when there is no hit, a NaN, or no mode in the band.
ModalFit identifySensor(const std::vector<std::vector<double>>& hammer,
                        const std::vector<std::vector<double>>& response, double sample_rate,
                        const SensorFitParameters& parameters);

/// Sensor models from a campaign's own tap tests. An axis without taps is ideal.
/// @throws Error when the campaign has no taps at all.
std::array<ModalModel, 3> identifySensor(const Campaign& campaign, const SensorFitParameters& parameters);

/// Sensor with its cross-talk, from taps along x, y and z. @throws Error when a direction has no taps.
SensorMatrix identifySensorMatrix(const Campaign& campaign, const SensorFitParameters& parameters);

/// Force on the tool of one cut through a sensor with cross-talk [N]; causal.
std::array<std::vector<double>, 3> compensate(const Record& record, const SensorMatrix& sensor,
                                              double spindle_speed, double sample_rate,
                                              const HarmonicFilterParameters& parameters);

/// Force on the tool of one cut, at the record's sample times [N]; any latency is taken out.
/// @param measures_workpiece the sensor measures the reaction: samples are negated.
std::array<std::vector<double>, 3> compensate(const Record& record, const std::array<ModalModel, 3>& sensor,
                                              bool measures_workpiece, double spindle_speed,
                                              double sample_rate, const HarmonicFilterParameters& parameters,
                                              Method method = Method::kalman, double lag = 0.05);

/// The model's `measures: force_on_workpiece`, of the file or, when that is empty, of the campaign's own
/// model; false without a model. @throws Error when a model cannot be read.
bool measuresWorkpiece(const Campaign& campaign, const std::string& model_file);

/// [rad/s] mean spindle speed of a record: of its tachometer, else the commanded one.
double spindleSpeedOf(const Record& record, const CampaignTest& test);

/// Negates fx, fy, fz: the reaction becomes the force on the tool.
void negateForces(Record& record);

}  // namespace smartmill::kalman
