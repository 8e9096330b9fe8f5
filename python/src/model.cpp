// Machine models, campaigns and their records.

#include "smartmill_core/model/machine_model.h"

#include <filesystem>
#include <optional>
#include <utility>
#include <vector>

#include <pybind11/stl/filesystem.h>

#include "convert.h"
#include "module.h"
#include "smartmill_core/axis_names.h"
#include "smartmill_core/campaign/campaign.h"
#include "smartmill_core/campaign/record.h"
#include "work.h"

namespace smartmill::python {
namespace {

MachineModel modelFrom(const py::object& tool, const py::object& cutting, const py::dict& tool_tip,
                       const py::dict& force_sensor) {
  MachineModel model;
  model.file = "model";
  if (!tool.is_none()) model.tool = toolOf(tool);
  if (!cutting.is_none()) {
    model.cutting = coefficientsOf(cutting, false);
    model.cutting_std = coefficientsOf(cutting, true);
  }
  for (const auto& [axis, modes] : tool_tip) {
    (axis.cast<std::string>() == "x" ? model.tool_tip.x : model.tool_tip.y) =
        receptanceOf(py::reinterpret_borrow<py::object>(modes));
  }
  for (const auto& [axis, modes] : force_sensor) {
    model.force_sensor.axis.at(static_cast<std::size_t>(axis.cast<std::string>()[0] - 'x')) =
        sensorOf(py::reinterpret_borrow<py::object>(modes));
  }
  return model;
}

py::object toolOrNone(const MachineModel& model) {
  return model.tool ? toPython(*model.tool) : py::object(py::none());
}

py::object cuttingOrNone(const MachineModel& model) {
  if (!model.cutting) return py::none();
  return toPython(*model.cutting, model.cutting_std ? &*model.cutting_std : nullptr);
}

py::dict toolTip(const MachineModel& model) {
  py::dict axes;
  axes["x"] = toPython(model.tool_tip.x.modes);
  axes["y"] = toPython(model.tool_tip.y.modes);
  return axes;
}

py::dict forceSensor(const MachineModel& model) {
  py::dict axes;
  for (std::size_t axis = 0; axis < 3; ++axis)
    axes[AXIS_NAMES[axis]] = toPython(model.force_sensor.axis[axis].modes);
  return axes;
}

py::tuple effects(const MachineModel& model) {
  return tupleOf(model.effects, [](const EffectEntry& effect) {
    py::dict keys;
    for (const auto& [key, value] : effect.numbers) keys[key.c_str()] = value;
    for (const auto& [key, word] : effect.words) keys[key.c_str()] = word;
    for (const auto& [key, list] : effect.lists) keys[key.c_str()] = list;
    return py::make_tuple(effect.name, keys);
  });
}

using Records = std::vector<std::pair<CampaignTest, Record>>;

py::tuple readCampaignRecords(const std::string& path) {
  Records records = interruptible(py::none(), [path](Work& work) {
    const Campaign campaign = readCampaign(path);
    Records read;
    for (const CampaignTest& test : campaign.tests) {
      work.check();
      read.emplace_back(test, readRecord(campaign, test));
    }
    return read;
  });
  return tupleOf(records, [](const auto& r) { return toPython(r.first, r.second); });
}

}  // namespace

void addModel(py::module_& m) {
  py::class_<MachineModel>(m, "Model",
                           "A machine model: tool, cutting coefficients, dynamics, spindle and effects.\n\n"
                           "Model(path) reads a model file (smartmill-model/1). Raises Error naming file, "
                           "key and value.")
      .def(py::init([](const std::filesystem::path& path) { return readMachineModel(path.string()); }),
           py::arg("path"))
      .def_readonly("file", &MachineModel::file, "File it was read from, for messages.")
      .def_property_readonly("tool", &toolOrNone, "Tool, or None.")
      .def_property_readonly("cutting", &cuttingOrNone, "Coefficients, or None.")
      .def_property_readonly("tool_tip", &toolTip,
                             "Modes of the receptance at the tool tip [m/N], by axis x and y.")
      .def_property_readonly("force_sensor", &forceSensor,
                             "Modes of the force sensor (measured over applied force, [1]), by axis x, y "
                             "and z.")
      .def_property_readonly("effects", &effects,
                             "(name, {key: value}) of each effect, in the units of the file.")
      .def(
          "at_position",
          [](const MachineModel& model, double position) { return atPosition(model, position); },
          py::arg("position"),
          "The model with the modes of a vibrating workpiece at a position [m] along it. Raises Error "
          "outside "
          "its places.")
      .def(
          "save",
          [](const MachineModel& model, const std::filesystem::path& path) {
            writeMachineModel(model, path.string());
          },
          py::arg("path"), "Write a model file.")
      .def("__copy__", [](const MachineModel& model) { return model; })
      .def("__deepcopy__", [](const MachineModel& model, const py::dict&) { return model; })
      .def("__repr__", [](const MachineModel& model) { return "<smartmill.Model " + model.file + ">"; });
  m.def("model_from", &modelFrom, py::arg("tool"), py::arg("cutting"), py::arg("tool_tip"),
        py::arg("force_sensor"));
  m.def("read_campaign", &readCampaignRecords, py::arg("path"));
}

}  // namespace smartmill::python
