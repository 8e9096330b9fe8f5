#include "convert.h"

#include <algorithm>
#include <limits>
#include <memory>

#include "smartmill_core/cutting/mechanistic.h"

namespace smartmill::python {
namespace {

constexpr double NOT_KNOWN = std::numeric_limits<double>::quiet_NaN();

/// @throws TypeError of Python for what is no number
double number(const py::handle& value) {
  const double result = PyFloat_AsDouble(value.ptr());
  if (PyErr_Occurred() != nullptr) throw py::error_already_set();
  return result;
}

double number(const py::object& object, const char* name) {
  return number(object.attr(name));
}

/// ktc of Ktc_n_per_mm2
std::string nameOf(const CuttingKey& k) {
  std::string name = k.key;
  name.erase(name.find('_'));
  name.front() = 'k';
  return name;
}

double stdOf(const py::object& object, const char* name) {
  return number(object.attr(name).attr("std"));
}

std::vector<Mode> modesOf(const py::object& modes) {
  std::vector<Mode> result;
  for (const py::handle& handle : modes) {
    const py::object mode = py::reinterpret_borrow<py::object>(handle);
    result.push_back({number(mode, "frequency"), number(mode, "damping_ratio"), number(mode, "gain"),
                      stdOf(mode, "frequency"), stdOf(mode, "damping_ratio"), stdOf(mode, "gain")});
  }
  return result;
}

}  // namespace

std::vector<double> vectorOf(const Array& array) {
  return {array.data(), array.data() + array.size()};
}

py::array arrayOf(std::vector<double> values) {
  auto owned = std::make_unique<std::vector<double>>(std::move(values));
  std::vector<double>* const data = owned.release();
  const py::capsule owner(data, [](void* p) { delete static_cast<std::vector<double>*>(p); });
  return py::array_t<double>(static_cast<py::ssize_t>(data->size()), data->data(), owner);
}

py::array arrayOf(const std::vector<std::vector<double>>& rows) {
  const std::size_t columns = rows.empty() ? 0 : rows.front().size();
  py::array_t<double> array({static_cast<py::ssize_t>(rows.size()), static_cast<py::ssize_t>(columns)});
  double* out = array.mutable_data();
  for (const std::vector<double>& row : rows) out = std::copy(row.begin(), row.end(), out);
  return array;
}

py::object estimate(double value, double std_dev) {
  return make("Estimate", value, std_dev);
}

py::object toPython(const Mode& mode) {
  return make("Mode", estimate(mode.frequency, mode.frequency_std),
              estimate(mode.damping_ratio, mode.damping_ratio_std), estimate(mode.gain, mode.gain_std));
}

py::object toPython(const std::vector<Mode>& modes) {
  return tupleOf(modes, [](const Mode& mode) { return toPython(mode); });
}

py::object toPython(const ToolGeometry& tool) {
  const auto numbers = [](const std::vector<double>& values) {
    return tupleOf(values, [](double value) { return py::float_(value); });
  };
  const EdgeShape& edge = tool.edge;
  return make("Tool", tool.teeth, tool.diameter, tool.helix, numbers(tool.pitch), edge.corner_radius,
              edge.edge_angle, numbers(edge.helix), edge.serration_amplitude, edge.serration_wavelength);
}

py::object toPython(const CuttingCoefficients& value, const CuttingCoefficients* std_dev) {
  py::dict fields;
  for (const CuttingKey& k : cuttingKeys()) {
    fields[nameOf(k).c_str()] =
        estimate(value.*k.coefficient, std_dev != nullptr ? std_dev->*k.coefficient : NOT_KNOWN);
  }
  return make("Coefficients", **fields);
}

py::object toPython(const Engagement& engagement, double spindle_speed, double feed_direction) {
  return make("Cut", spindle_speed, engagement.feed_per_tooth, engagement.axial_depth, engagement.entry,
              engagement.exit, feed_direction);
}

py::object toPython(const CampaignTest& test, Record record) {
  const char* const kind = testKindName(test.kind);
  py::dict channels;
  for (std::size_t c = 0; c < record.names.size(); ++c)
    channels[record.names[c].c_str()] = arrayOf(std::move(record.columns[c]));
  const py::object cut = test.engagement ? toPython(*test.engagement, test.spindle_speed, test.feed_direction)
                                         : py::object(py::none());
  return make("Record", test.name, kind, test.sample_rate, test.spindle_speed, cut, test.direction,
              arrayOf(std::move(record.time)), channels);
}

ModalModel receptanceOf(const py::object& modes) {
  ModalModel model;
  model.modes = modesOf(modes);
  return model;
}

ModalModel sensorOf(const py::object& modes) {
  ModalModel model;
  model.direct = 1.0;
  if (modes.is_none()) return model;
  model.modes = modesOf(modes);
  for (const Mode& mode : model.modes) model.direct -= mode.gain;
  return model;
}

ToolGeometry toolOf(const py::object& tool) {
  ToolGeometry geometry;
  geometry.teeth = static_cast<int>(PyLong_AsLong(tool.attr("teeth").ptr()));
  if (PyErr_Occurred() != nullptr) throw py::error_already_set();
  geometry.diameter = number(tool, "diameter");
  geometry.helix = number(tool, "helix");
  for (const py::handle& pitch : tool.attr("pitch")) geometry.pitch.push_back(number(pitch));
  EdgeShape& edge = geometry.edge;
  edge.corner_radius = number(tool, "corner_radius");
  edge.edge_angle = number(tool, "edge_angle");
  edge.serration_amplitude = number(tool, "serration_amplitude");
  edge.serration_wavelength = number(tool, "serration_wavelength");
  std::vector<double> helix;
  for (const py::handle& of_tooth : tool.attr("tooth_helix")) helix.push_back(number(of_tooth));
  if (!helix.empty()) geometry.setHelix(helix);
  validate(geometry);
  return geometry;
}

CuttingCoefficients coefficientsOf(const py::object& coefficients, bool std_dev) {
  CuttingCoefficients result;
  for (const CuttingKey& k : cuttingKeys()) {
    const std::string name = nameOf(k);
    result.*k.coefficient = std_dev ? stdOf(coefficients, name.c_str()) : number(coefficients, name.c_str());
  }
  return result;
}

Engagement engagementOf(const py::object& cut) {
  const Engagement engagement{number(cut, "entry"), number(cut, "exit"), number(cut, "axial_depth"),
                              number(cut, "feed_per_tooth")};
  validate(engagement);
  return engagement;
}

MachineModel modelOf(const Campaign& campaign, const std::optional<MachineModel>& model) {
  return model ? *model : readMachineModel(campaign.modelPath());
}

}  // namespace smartmill::python
