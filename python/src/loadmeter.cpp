#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include "convert.h"
#include "module.h"
#include "smartmill_core/cutting/regression.h"
#include "smartmill_loadmeter/identification/campaign_identification.h"
#include "work.h"

namespace smartmill::python {
namespace {

using namespace smartmill::loadmeter;

py::array_t<double> covarianceOf(const IdentifiedCoefficients& found) {
  py::array_t<double> covariance({6, 6});
  for (Eigen::Index i = 0; i < 6; ++i)
    for (Eigen::Index j = 0; j < 6; ++j) covariance.mutable_at(i, j) = found.covariance(i, j);
  return covariance;
}

py::object resultOf(const IdentifiedCoefficients& found) {
  return make("CoefficientResult", "force", toPython(found.value, &found.std_dev), found.tests,
              covarianceOf(found), py::make_tuple(found.r_squared_x, found.r_squared_y, found.r_squared_z));
}

py::object resultOf(const LoadRecordResult& found) {
  using py::arg;
  return make("CoefficientResult", arg("source") = "load_meter",
              arg("coefficients") = toPython(found.set.value, &found.set.std_dev),
              arg("tests") = found.set.tests, arg("covariance") = py::none(), arg("r_squared") = py::none(),
              arg("friction_viscous") = found.set.friction_viscous,
              arg("friction_coulomb") = found.set.friction_coulomb, arg("misfit") = found.misfit,
              arg("terms") = py::tuple(py::cast(found.terms)),
              arg("notes") = py::tuple(py::cast(found.notes)));
}

py::object fromForceRecords(const std::string& path, const std::optional<MachineModel>& given,
                            bool revolutions) {
  return resultOf(interruptible(py::none(), [=](Work&) {
    const Campaign campaign = readCampaign(path);
    return identifyFromForceRecords(campaign, modelOf(campaign, given),
                                    revolutions ? Means::revolutions : Means::all);
  }));
}

py::object fromLoadMeter(const std::string& path, const std::optional<MachineModel>& given) {
  return resultOf(interruptible(py::none(), [=](Work&) {
    const Campaign campaign = readCampaign(path);
    return identifyFromLoadRecords(campaign, modelOf(campaign, given), {});
  }));
}

py::object fromMeanForces(const py::object& tool, const py::list& cuts, const Array& force,
                          const std::optional<Array>& std_dev) {
  std::vector<MeanForceTest> tests;
  const auto row = [](const Array& array, py::ssize_t i) {
    return std::array<double, 3>{array.data()[3 * i], array.data()[3 * i + 1], array.data()[3 * i + 2]};
  };
  for (py::ssize_t i = 0; i < static_cast<py::ssize_t>(cuts.size()); ++i) {
    tests.push_back({toolOf(tool), engagementOf(cuts[static_cast<std::size_t>(i)]), row(force, i)});
    if (std_dev) tests.back().force_std = row(*std_dev, i);
  }
  return resultOf(interruptible(py::none(), [tests](Work&) { return identifyFromForces(tests); }));
}

}  // namespace

void addLoadmeter(py::module_& m) {
  m.def("coefficients_of_forces", &fromForceRecords, py::arg("campaign"), py::arg("model"),
        py::arg("revolutions"));
  m.def("coefficients_of_load_meter", &fromLoadMeter, py::arg("campaign"), py::arg("model"));
  m.def("coefficients_of_means", &fromMeanForces, py::arg("tool"), py::arg("cuts"), py::arg("force"),
        py::arg("std"));
}

}  // namespace smartmill::python
