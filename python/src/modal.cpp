#include <cmath>
#include <complex>
#include <string>
#include <vector>

#include <pybind11/complex.h>

#include "convert.h"
#include "module.h"
#include "smartmill_core/campaign/record.h"
#include "smartmill_core/error.h"
#include "smartmill_core/modal/frf_files.h"
#include "smartmill_core/modal/modal_estimate.h"
#include "smartmill_core/signal/frequency_response.h"
#include "smartmill_core/units.h"
#include "smartmill_hammer/analysis/tap_records.h"
#include "work.h"

namespace smartmill::python {
namespace {

using namespace smartmill::hammer;

struct FitOptions {
  std::string file;              // first input, for messages; empty: arrays
  double low = 0.0, high = 0.0;  // [Hz]
  int max_modes = 0;             // 0: no fit
  bool real_modes = false;
  std::string average;
  double weak_force = 0.0;        // [N]
  double exponential_time = 0.0;  // [s]
};

struct Found {
  FrequencyResponse frf;
  std::vector<TapVerdict> hits;
  ModalEstimate estimate;
  std::vector<std::complex<double>> fitted;
};

FrfAverage averageOf(const std::string& name) {
  if (name == "h1") return FrfAverage::h1;
  if (name == "h2") return FrfAverage::h2;
  return FrfAverage::hv;
}

/// Modes of an FRF. @param truncated_length see TapFrf
void fit(const FitOptions& options, double truncated_length, Work& work, Found& found) {
  if (options.max_modes == 0) return;
  ModalEstimateOptions search;
  search.low = options.low;
  search.high = options.high;
  search.max_modes = options.max_modes;
  search.real_modes = options.real_modes;
  search.progress = [&work](double share) {
    work.progress(share);
    return true;
  };
  try {
    found.estimate = estimateModes({found.frf}, search);
  } catch (const Error& error) {
    throw Error((options.file.empty() ? "" : options.file + ": ") + error.what());
  }
  for (const double f : found.frf.frequency) found.fitted.push_back(fittedResponse(found.estimate, 0, f));
  for (std::vector<EstimatedMode>* modes : {&found.estimate.modes, &found.estimate.doubts}) {
    // The exponential window's own damping.
    if (options.exponential_time > 0.0)
      for (EstimatedMode& m : *modes)
        m.damping_ratio -= 1.0 / (options.exponential_time * units::TWO_PI * m.frequency);
    correctTruncation(*modes, truncated_length);
  }
}

Found average(const std::vector<TapRecord>& taps, const FitOptions& options, Work& work) {
  TapFrfOptions how;
  how.check.weak_force = options.weak_force;
  how.check.high = options.high;
  how.exponential_time = options.exponential_time;
  how.average = averageOf(options.average);
  const TapFrf averaged = averageTaps(taps, how);
  Found found{averaged.receptance, averaged.hits, {}, {}};
  if (found.frf.averages == 0)
    throw Error("no hit was accepted; " + found.hits.back().file + ": " + found.hits.back().reason);
  fit(options, averaged.truncated_length, work, found);
  return found;
}

Found readAll(const std::vector<std::string>& files, FitOptions options, Work& work) {
  options.file = files.front();
  std::vector<TapRecord> taps;
  std::vector<NamedFrf> frfs;
  for (const std::string& file : files) {
    work.check();
    TapFile read = readTapFile(file, detectFormat(file), {});
    taps.insert(taps.end(), read.taps.begin(), read.taps.end());
    frfs.insert(frfs.end(), read.frfs.begin(), read.frfs.end());
  }
  if (!taps.empty() && !frfs.empty())
    throw Error(frfs.front().name + ": an FRF cannot be combined with hits over time");
  if (!taps.empty()) return average(taps, options, work);
  if (frfs.size() != 1)
    throw Error(files.back() + ": expected hits of one point or one FRF, found " +
                std::to_string(frfs.size()) + " FRFs");
  Found found{frfs.front().frf, {}, {}, {}};
  fit(options, 0.0, work, found);
  return found;
}

py::array arrayOfComplex(const std::vector<std::complex<double>>& values) {
  return py::array_t<std::complex<double>>(static_cast<py::ssize_t>(values.size()), values.data());
}

py::tuple toPython(const std::vector<EstimatedMode>& modes) {
  return tupleOf(modes, [](const EstimatedMode& m) {
    const Gain gain = gainOf(m, 0);
    return make("Mode", estimate(m.frequency, m.frequency_std),
                estimate(m.damping_ratio, m.damping_ratio_std), estimate(gain.value, gain.std), gain.phase,
                m.evidence);
  });
}

py::object toPython(Found found) {
  using py::arg;
  const auto known = [&](std::vector<double>& values) {
    values.resize(found.frf.size(), std::nan(""));
    return arrayOf(std::move(values));
  };
  return make(
      "Frf", arg("frequency") = arrayOf(found.frf.frequency), arg("value") = arrayOfComplex(found.frf.value),
      arg("std") = known(found.frf.std_dev), arg("coherence") = known(found.frf.coherence),
      arg("unit") = found.frf.unit, arg("modes") = toPython(found.estimate.modes),
      arg("doubts") = toPython(found.estimate.doubts), arg("fitted") = arrayOfComplex(found.fitted),
      arg("hits") = tupleOf(found.hits,
                            [](const TapVerdict& v) { return make("Hit", v.file, v.accepted(), v.reason); }));
}

FitOptions optionsOf(const py::dict& d) {
  return {"",
          d["low"].cast<double>(),
          d["high"].cast<double>(),
          d["max_modes"].cast<int>(),
          d["real_modes"].cast<bool>(),
          d["average"].cast<std::string>(),
          d["weak_force"].cast<double>(),
          d["exponential_time"].cast<double>()};
}

py::object frfOfArrays(const std::vector<Array>& force, const std::vector<Array>& response, double rate,
                       const std::string& kind, const py::dict& options, const py::object& progress) {
  std::vector<TapRecord> taps;
  for (std::size_t i = 0; i < force.size(); ++i) {
    Record record;
    record.file = "hit " + std::to_string(i + 1);
    for (py::ssize_t k = 0; k < force[i].size(); ++k) record.time.push_back(static_cast<double>(k) / rate);
    record.add("hammer") = vectorOf(force[i]);
    record.add(kind) = vectorOf(response[i]);
    taps.push_back(tapOf(record, {"", kind, ""}));
  }
  return toPython(interruptible(
      progress, [taps, chosen = optionsOf(options)](Work& work) { return average(taps, chosen, work); }));
}

py::object frfOfFiles(const std::vector<std::string>& files, const py::dict& options,
                      const py::object& progress) {
  return toPython(interruptible(
      progress, [files, chosen = optionsOf(options)](Work& work) { return readAll(files, chosen, work); }));
}

py::object modes(const Array& frequency, const py::array_t<std::complex<double>, py::array::c_style>& value,
                 const std::optional<Array>& std_dev, const std::string& unit, const py::dict& options,
                 const py::object& progress) {
  Found found;
  found.frf.frequency = vectorOf(frequency);
  found.frf.value.assign(value.data(), value.data() + value.size());
  if (std_dev) found.frf.std_dev = vectorOf(*std_dev);
  found.frf.unit = unit;
  return toPython(interruptible(progress, [found, chosen = optionsOf(options)](Work& work) mutable {
    fit(chosen, 0.0, work, found);
    return found;
  }));
}

}  // namespace

void addModal(py::module_& m) {
  m.def("frf", &frfOfArrays, py::arg("force"), py::arg("response"), py::arg("rate"), py::arg("kind"),
        py::arg("options"), py::arg("progress"));
  m.def("frf_of_files", &frfOfFiles, py::arg("files"), py::arg("options"), py::arg("progress"));
  m.def("modes", &modes, py::arg("frequency"), py::arg("value"), py::arg("std"), py::arg("unit"),
        py::arg("options"), py::arg("progress"));
}

}  // namespace smartmill::python
