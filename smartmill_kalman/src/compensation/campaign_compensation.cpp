#include "smartmill_kalman/compensation/campaign_compensation.h"

#include <algorithm>
#include <cmath>
#include <filesystem>

#include "smartmill_core/axis_names.h"
#include "smartmill_core/error.h"
#include "smartmill_core/model/machine_model.h"
#include "smartmill_core/signal/force_channels.h"
#include "smartmill_core/signal/frequency_response.h"
#include "smartmill_core/signal/statistics.h"
#include "smartmill_core/signal/window.h"
#include "smartmill_core/units.h"

namespace smartmill::kalman {
namespace {}  // namespace

void SensorFitParameters::validate() const {
  if (!(low >= 0.0) || !(high > low)) {
    throw Error("sensor fit: the band " + std::to_string(low) + " .. " + std::to_string(high) +
                " Hz is empty");
  }
  if (max_modes < 1 || max_modes > 20) {
    throw Error("max_modes: " + std::to_string(max_modes) + ", expected 1 .. 20");
  }
}

FrequencyResponse averagedFrf(const std::vector<std::vector<double>>& hammer,
                              const std::vector<std::vector<double>>& response, double sample_rate) {
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
    // The samples before the hit are noise.
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
  return estimator.h1("1");
}

namespace {

/// Whether the response at low frequency is negative: hit against the axis, or a sensor of the reaction.
bool hasNegativeStaticGain(const FrequencyResponse& frf, double low) {
  double sum = 0.0;
  for (const auto& value : frf.band(low, 3.0 * low + 50.0).value) sum += value.real();
  return sum < 0.0;
}

struct Taps {
  std::vector<std::vector<double>> hammer;
  std::array<std::vector<std::vector<double>>, 3> response;  // of fx, fy, fz
  double rate = 0.0;                                         // [Hz]
};

Taps tapsAlong(const Campaign& campaign, std::size_t axis) {
  Taps taps;
  for (const CampaignTest& test : campaign.tests) {
    if (test.kind != TestKind::tap || test.direction != AXIS_NAMES[axis]) continue;
    const Record record = readRecord(campaign, test);
    if (taps.rate != 0.0 && (taps.rate != test.sample_rate || record.size() != taps.hammer.front().size())) {
      throw Error(record.file + ": sample rate or length differs from the other taps of this direction");
    }
    taps.rate = test.sample_rate;
    taps.hammer.push_back(record.column("hammer"));
    for (std::size_t i = 0; i < 3; ++i) taps.response[i].push_back(record.column(FORCE_CHANNELS[i]));
  }
  return taps;
}

}  // namespace

ModalFit identifySensor(const std::vector<std::vector<double>>& hammer,
                        const std::vector<std::vector<double>>& response, double sample_rate,
                        const SensorFitParameters& parameters) {
  parameters.validate();
  ModalFitOptions options;
  options.low = parameters.low;
  options.high = std::min(parameters.high, 0.45 * sample_rate);
  options.max_modes = parameters.max_modes;
  options.unit_static_gain = true;
  FrequencyResponse measured = averagedFrf(hammer, response, sample_rate);
  if (hasNegativeStaticGain(measured, parameters.low)) {
    for (auto& value : measured.value) value = -value;
  }
  return fitModes(measured, options);
}

std::array<ModalModel, 3> identifySensor(const Campaign& campaign, const SensorFitParameters& parameters) {
  std::array<ModalModel, 3> sensor;
  bool any = false;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    sensor[axis].direct = 1.0;
    const Taps taps = tapsAlong(campaign, axis);
    if (taps.hammer.empty()) continue;
    any = true;
    sensor[axis] = identifySensor(taps.hammer, taps.response[axis], taps.rate, parameters).model;
  }
  if (!any) throw Error(campaign.folder + ": no taps to identify the force sensor from");
  return sensor;
}

bool measuresWorkpiece(const Campaign& campaign, const std::string& model_file) {
  const std::string file = model_file.empty() ? campaign.modelPath() : model_file;
  if (model_file.empty() && (file.empty() || !std::filesystem::is_regular_file(file))) return false;
  return readMachineModel(file).force_sensor.measures_workpiece;
}

double spindleSpeedOf(const Record& record, const CampaignTest& test) {
  if (!test.tachometer || !record.has("spindle_angle")) return test.spindle_speed;
  const std::vector<double>& angle = record.column("spindle_angle");
  double turned = 0.0;
  for (std::size_t i = 1; i < angle.size(); ++i)
    turned += std::remainder(angle[i] - angle[i - 1], units::TWO_PI);
  return turned / (record.time.back() - record.time.front());
}

void negateForces(Record& record) {
  for (std::size_t i = 0; i < record.names.size(); ++i) {
    if (std::find(FORCE_CHANNELS.begin(), FORCE_CHANNELS.end(), record.names[i]) == FORCE_CHANNELS.end())
      continue;
    for (double& sample : record.columns[i]) sample = -sample;
  }
}

std::array<std::vector<double>, 3> compensate(const Record& record, const std::array<ModalModel, 3>& sensor,
                                              bool measures_workpiece, double spindle_speed,
                                              double sample_rate, const HarmonicFilterParameters& parameters,
                                              Method method, double lag) {
  std::array<std::vector<double>, 3> force;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    std::vector<double> measured = record.column(FORCE_CHANNELS[axis]);
    if (measures_workpiece) {
      for (double& sample : measured) sample = -sample;
    }
    force[axis] =
        compensateRecord(method, measured, sensor[axis], spindle_speed, sample_rate, parameters, lag);
  }
  return force;
}

SensorMatrix identifySensorMatrix(const Campaign& campaign, const SensorFitParameters& parameters) {
  SensorMatrix sensor;
  std::array<Taps, 3> taps;
  for (std::size_t j = 0; j < 3; ++j) {
    taps[j] = tapsAlong(campaign, j);
    if (taps[j].hammer.empty())
      throw Error(campaign.folder + ": no taps for the cross-talk along " + AXIS_NAMES[j]);
    sensor.h[j][j] = identifySensor(taps[j].hammer, taps[j].response[j], taps[j].rate, parameters).model;
  }
  for (std::size_t j = 0; j < 3; ++j) {
    for (std::size_t i = 0; i < 3; ++i) {
      if (i == j) continue;
      FrequencyResponse across = averagedFrf(taps[j].hammer, taps[j].response[i], taps[j].rate);
      if (hasNegativeStaticGain(averagedFrf(taps[j].hammer, taps[j].response[j], taps[j].rate),
                                parameters.low)) {
        for (auto& value : across.value) value = -value;
      }
      sensor.h[i][j] = fitCrossTalk(across, sensor.h[j][j], sensor.h[i][i], parameters.low,
                                    std::min(parameters.high, 0.45 * taps[j].rate));
    }
  }
  return sensor;
}

std::array<std::vector<double>, 3> compensate(const Record& record, const SensorMatrix& sensor,
                                              double spindle_speed, double sample_rate,
                                              const HarmonicFilterParameters& parameters) {
  CoupledFilter filter(sensor, spindle_speed, sample_rate, parameters);
  std::array<std::vector<double>, 3> force;
  const std::array<const std::vector<double>*, 3> measured{
      {&record.column("fx"), &record.column("fy"), &record.column("fz")}};
  for (std::size_t i = 0; i < record.size(); ++i) {
    const auto found = filter.step({(*measured[0])[i], (*measured[1])[i], (*measured[2])[i]});
    for (std::size_t axis = 0; axis < 3; ++axis) force[axis].push_back(found[axis]);
  }
  return force;
}

}  // namespace smartmill::kalman
