#include "module.h"

#include <filesystem>

#include "smartmill_core/error.h"
#include "smartmill_core/program.h"
#include "work.h"

namespace {

// The program's one line as an exception of smartmill/results.py.
void raise(const char* name, const char* what) {
  const pybind11::object type = pybind11::module_::import("smartmill.results").attr(name);
  PyErr_SetString(type.ptr(), what);
}

}  // namespace

PYBIND11_MODULE(_smartmill, m) {
  namespace python = smartmill::python;
  m.doc() = "The compiled part of smartmill. Arguments are checked by the Python functions that call it.";
  pybind11::register_exception_translator(
      [](std::exception_ptr thrown) {  // NOLINT(performance-unnecessary-value-param)
        try {
          if (thrown) std::rethrow_exception(thrown);
        } catch (const smartmill::UsageError& error) {
          raise("UsageError", error.what());
        } catch (const smartmill::Error& error) {
          raise("Error", error.what());
        } catch (const std::filesystem::filesystem_error& error) {
          raise("Error", error.what());
        }
      });
  m.def("wait_for_abandoned", &python::waitForAbandoned,
        "Wait for the threads of interrupted calls; registered with atexit.");
  python::addModel(m);
  python::addSimulate(m);
  python::addDiscrepancy(m);
  python::addStability(m);
  python::addModal(m);
  python::addLoadmeter(m);
  python::addKalman(m);
}
