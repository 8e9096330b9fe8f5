#include "smartmill_kalman/campaign_compensation.h"

#include <cmath>

#include "smartmill_core/error.h"
#include "smartmill_core/signal/frequency_response.h"
#include "smartmill_core/signal/statistics.h"
#include "smartmill_core/signal/window.h"

namespace smartmill::kalman {
namespace {

const std::array<const char*, 3> FORCES{{"fx", "fy", "fz"}};
const std::array<const char*, 3> DIRECTIONS{{"x", "y", "z"}};

}  // namespace

void SensorFitParameters::validate() const {
  if (!(low >= 0.0) || !(high > low)) {
    throw Error("sensor fit: the band " + std::to_string(low) + " .. " + std::to_string(high) +
                " Hz is empty");
  }
  if (max_modes < 1 || max_modes > 20) {
    throw Error("max_modes: " + std::to_string(max_modes) + ", 1 .. 20 is due");
  }
}

ModalFit identifySensor(const std::vector<std::vector<double>>& hammer,
                        const std::vector<std::vector<double>>& response, double sample_rate,
                        const SensorFitParameters& parameters) {
  parameters.validate();
  if (hammer.empty() || hammer.size() != response.size()) throw Error("sensor identification: no hits");
  FrfEstimator estimator(sample_rate, hammer.front().size());
  for (std::size_t i = 0; i < hammer.size(); ++i) {
    const std::vector<double> window = impactWindow(hammer[i]);
    std::vector<double> force = hammer[i];
    double share = 0.0, window_power = 0.0, rest = 0.0, rest_response = 0.0;
    std::size_t before = 0;
    for (std::size_t k = 0; k < force.size(); ++k) {
      force[k] *= window[k];
      window_power += window[k] * window[k];
    }
    // What stands before the hit is noise.
    while (before < window.size() && window[before] == 0.0) {
      rest += hammer[i][before] * hammer[i][before];
      rest_response += response[i][before] * response[i][before];
      ++before;
    }
    share = window_power / static_cast<double>(window.size());
    if (before > 10) {
      estimator.setNoise(std::sqrt(rest / before), std::sqrt(rest_response / before), share);
    }
    estimator.add(force, response[i]);
  }
  ModalFitOptions options;
  options.low = parameters.low;
  options.high = std::min(parameters.high, 0.45 * sample_rate);
  options.max_modes = parameters.max_modes;
  options.unit_static_gain = true;
  return fitModes(estimator.h1("1"), options);
}

std::array<ModalModel, 3> identifySensor(const Campaign& campaign, const SensorFitParameters& parameters) {
  std::array<ModalModel, 3> sensor;
  bool any = false;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    sensor[axis].direct = 1.0;
    std::vector<std::vector<double>> hammer, response;
    double rate = 0.0;
    for (const CampaignTest& test : campaign.tests) {
      if (test.kind != TestKind::tap || test.direction != DIRECTIONS[axis]) continue;
      const Record record = readRecord(campaign, test);
      if (rate != 0.0 && (rate != test.sample_rate || record.size() != hammer.front().size())) {
        throw Error(record.file + ": taps of one direction need one rate and one length");
      }
      rate = test.sample_rate;
      hammer.push_back(record.column("hammer"));
      response.push_back(record.column(FORCES[axis]));
    }
    if (hammer.empty()) continue;
    any = true;
    sensor[axis] = identifySensor(hammer, response, rate, parameters).model;
  }
  if (!any) throw Error(campaign.folder + ": the campaign has no taps to identify the force sensor from");
  return sensor;
}

std::array<std::vector<double>, 3> compensate(const Record& record, const std::array<ModalModel, 3>& sensor,
                                              bool measures_workpiece, double spindle_speed,
                                              double sample_rate, const HarmonicFilterParameters& parameters,
                                              Method method) {
  std::array<std::vector<double>, 3> force;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    std::vector<double> measured = record.column(FORCES[axis]);
    if (measures_workpiece) {
      for (double& sample : measured) sample = -sample;
    }
    force[axis] = compensateRecord(method, measured, sensor[axis], spindle_speed, sample_rate, parameters);
  }
  return force;
}

}  // namespace smartmill::kalman
