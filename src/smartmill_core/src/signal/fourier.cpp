#include "smartmill_core/signal/fourier.h"

#include <fftw3.h>

#include <algorithm>
#include <memory>
#include <mutex>
#include <string>

#include "smartmill_core/error.h"

namespace smartmill {
namespace {

// FFTW's planner has global state: only plan execution is safe from several threads.
std::mutex planner_mutex;

struct Free {
  void operator()(void* memory) const { fftw_free(memory); }
};

template <class Type>
std::unique_ptr<Type[], Free> allocate(std::size_t n) {
  return std::unique_ptr<Type[], Free>(static_cast<Type*>(fftw_malloc(n * sizeof(Type))));
}

class Plan {
 public:
  Plan(std::size_t n, double* real, fftw_complex* complex, bool forward) {
    const std::lock_guard<std::mutex> lock(planner_mutex);
    const int size = static_cast<int>(n);
    // ESTIMATE: the same plan at every run, so that results repeat to the last digit.
    plan_ = forward ? fftw_plan_dft_r2c_1d(size, real, complex, FFTW_ESTIMATE)
                    : fftw_plan_dft_c2r_1d(size, complex, real, FFTW_ESTIMATE);
  }
  ~Plan() {
    const std::lock_guard<std::mutex> lock(planner_mutex);
    fftw_destroy_plan(plan_);
  }
  Plan(const Plan&) = delete;
  Plan& operator=(const Plan&) = delete;
  void run() const { fftw_execute(plan_); }

 private:
  fftw_plan plan_;
};

}  // namespace

std::vector<std::complex<double>> fourier(const std::vector<double>& signal) {
  const std::size_t n = signal.size();
  if (n == 0) {
    throw Error("Fourier transform: the signal is empty");
  }
  const auto real = allocate<double>(n);
  const auto complex = allocate<fftw_complex>(n / 2 + 1);
  const Plan plan(n, real.get(), complex.get(), true);
  std::copy(signal.begin(), signal.end(), real.get());
  plan.run();
  std::vector<std::complex<double>> spectrum(n / 2 + 1);
  for (std::size_t k = 0; k < spectrum.size(); ++k) {
    spectrum[k] = {complex[k][0], complex[k][1]};
  }
  return spectrum;
}

std::vector<double> inverseFourier(const std::vector<std::complex<double>>& spectrum, std::size_t n) {
  if (n == 0 || spectrum.size() != n / 2 + 1) {
    throw Error("inverse Fourier transform: " + std::to_string(n) + " samples need " +
                std::to_string(n / 2 + 1) + " lines, got " + std::to_string(spectrum.size()));
  }
  const auto real = allocate<double>(n);
  const auto complex = allocate<fftw_complex>(n / 2 + 1);
  const Plan plan(n, real.get(), complex.get(), false);
  for (std::size_t k = 0; k < spectrum.size(); ++k) {
    complex[k][0] = spectrum[k].real();
    complex[k][1] = spectrum[k].imag();
  }
  plan.run();
  std::vector<double> signal(real.get(), real.get() + n);
  for (double& value : signal) {
    value /= static_cast<double>(n);
  }
  return signal;
}

std::vector<double> fourierFrequencies(std::size_t n, double sample_rate) {
  std::vector<double> frequency(n / 2 + 1);
  for (std::size_t k = 0; k < frequency.size(); ++k) {
    frequency[k] = static_cast<double>(k) * sample_rate / static_cast<double>(n);
  }
  return frequency;
}

}  // namespace smartmill
