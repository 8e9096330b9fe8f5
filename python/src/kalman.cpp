#include <array>
#include <string>
#include <utility>
#include <vector>

#include "convert.h"
#include "module.h"
#include "smartmill_core/axis_names.h"
#include "smartmill_core/error.h"
#include "smartmill_core/signal/force_channels.h"
#include "smartmill_kalman/compensation/campaign_compensation.h"
#include "smartmill_kalman/compensation/record_compensation.h"
#include "work.h"

namespace smartmill::python {
namespace {

using namespace smartmill::kalman;

struct Method {
  std::string name;
  HarmonicFilterParameters filter;
  double lag = 0.05;  // [s]
};

Method methodFrom(const std::string& name, double bandwidth, double noise_rms, double lag) {
  Method method{name, {}, lag};
  method.filter.bandwidth = bandwidth;
  method.filter.noise_rms = noise_rms;
  method.filter.validate();
  methodOf(name);
  return method;
}

std::vector<double> compensateOne(const std::vector<double>& measured, const ModalModel& sensor, double speed,
                                  double rate, const Method& method) {
  return compensateRecord(methodOf(method.name), measured, sensor, speed, rate, method.filter, method.lag);
}

py::tuple compensateArrays(const std::vector<Array>& measured, const py::list& sensor, double rate,
                           double speed, const std::string& name, double bandwidth, double noise_rms,
                           double lag) {
  const Method method = methodFrom(name, bandwidth, noise_rms, lag);
  std::vector<std::vector<double>> values;
  std::vector<ModalModel> models;
  for (std::size_t axis = 0; axis < measured.size(); ++axis) {
    values.push_back(vectorOf(measured[axis]));
    models.push_back(sensorOf(sensor[axis]));
  }
  auto forces = interruptible(py::none(), [=](Work& work) {
    std::vector<std::vector<double>> result;
    for (std::size_t axis = 0; axis < values.size(); ++axis) {
      work.check();
      result.push_back(compensateOne(values[axis], models[axis], speed, rate, method));
    }
    return result;
  });
  return tupleOf(forces, [](const auto& force) { return arrayOf(force); });
}

py::tuple compensateCampaign(const std::string& path, const std::optional<MachineModel>& given, bool identify,
                             const std::string& name, double bandwidth, double noise_rms, double lag,
                             const py::object& progress) {
  struct Found {
    std::array<ModalModel, 3> sensor;
    std::vector<std::pair<CampaignTest, Record>> cuts;
  };
  const Method method = methodFrom(name, bandwidth, noise_rms, lag);
  Found found = interruptible(progress, [=](Work& work) {
    const Campaign campaign = readCampaign(path);
    Found result;
    bool workpiece = false;
    if (identify) {
      workpiece = given ? given->force_sensor.measures_workpiece : measuresWorkpiece(campaign, "");
      result.sensor = identifySensor(campaign, SensorFitParameters());
    } else {
      const MachineModel model = modelOf(campaign, given);
      result.sensor = model.force_sensor.axis;
      workpiece = model.force_sensor.measures_workpiece;
    }
    double done = 0.0;
    for (const CampaignTest& test : campaign.tests) {
      work.progress(done++ / static_cast<double>(campaign.tests.size()));
      if (test.kind != TestKind::cut) continue;
      Record record = readRecord(campaign, test);
      auto force = compensate(record, result.sensor, workpiece, test.spindle_speed, test.sample_rate,
                              method.filter, methodOf(method.name), method.lag);
      Record compensated;
      compensated.time = std::move(record.time);
      for (std::size_t axis = 0; axis < 3; ++axis)
        compensated.add(FORCE_CHANNELS[axis]) = std::move(force[axis]);
      result.cuts.emplace_back(test, std::move(compensated));
    }
    if (result.cuts.empty()) throw Error(campaign.folder + ": the campaign has no cuts");
    work.progress(1.0);
    return result;
  });
  py::dict sensor;
  for (std::size_t axis = 0; axis < 3; ++axis) sensor[AXIS_NAMES[axis]] = toPython(found.sensor[axis].modes);
  return py::make_tuple(sensor,
                        tupleOf(found.cuts, [](const auto& cut) { return toPython(cut.first, cut.second); }));
}

}  // namespace

void addKalman(py::module_& m) {
  m.def("compensate", &compensateArrays, py::arg("measured"), py::arg("sensor"), py::arg("rate"),
        py::arg("spindle_speed"), py::arg("method"), py::arg("bandwidth"), py::arg("noise_rms"),
        py::arg("lag"));
  m.def("compensate_campaign", &compensateCampaign, py::arg("campaign"), py::arg("model"),
        py::arg("identify"), py::arg("method"), py::arg("bandwidth"), py::arg("noise_rms"), py::arg("lag"),
        py::arg("progress"));
}

}  // namespace smartmill::python
