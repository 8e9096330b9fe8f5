#include "smartmill_core/signal/fourier.h"

#include <fftw3.h>

#include <algorithm>
#include <deque>
#include <memory>
#include <mutex>
#include <string>
#include <utility>

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
    // ESTIMATE: the same plan in every run, so that results are reproducible to the last digit.
    plan_ = forward ? fftw_plan_dft_r2c_1d(size, real, complex, FFTW_ESTIMATE)
                    : fftw_plan_dft_c2r_1d(size, complex, real, FFTW_ESTIMATE);
  }
  ~Plan() {
    const std::lock_guard<std::mutex> lock(planner_mutex);
    fftw_destroy_plan(plan_);
  }
  Plan(const Plan&) = delete;
  Plan& operator=(const Plan&) = delete;
  void forward(double* real, fftw_complex* complex) const { fftw_execute_dft_r2c(plan_, real, complex); }
  void backward(fftw_complex* complex, double* real) const { fftw_execute_dft_c2r(plan_, complex, real); }

 private:
  fftw_plan plan_;
};

// Cache of the most recently used lengths: a plan costs more than the transform. It is valid for any memory
// allocated by FFTW.
std::shared_ptr<const Plan> planOf(std::size_t n, double* real, fftw_complex* complex, bool forward) {
  constexpr std::size_t KEPT = 16;
  using Key = std::pair<std::size_t, bool>;
  static std::mutex mutex;
  static std::deque<std::pair<Key, std::shared_ptr<const Plan>>> cache;  // most recently used first
  const Key key{n, forward};
  const std::lock_guard<std::mutex> lock(mutex);
  const auto found = std::find_if(cache.begin(), cache.end(), [&](const auto& k) { return k.first == key; });
  if (found != cache.end()) {
    std::rotate(cache.begin(), found, found + 1);
    return cache.front().second;
  }
  cache.emplace_front(key, std::make_shared<const Plan>(n, real, complex, forward));
  if (cache.size() > KEPT) cache.pop_back();
  return cache.front().second;
}

}  // namespace

std::vector<std::complex<double>> fourier(const std::vector<double>& signal) {
  const std::size_t n = signal.size();
  if (n == 0) {
    throw Error("Fourier transform: the signal is empty");
  }
  const auto real = allocate<double>(n);
  const auto complex = allocate<fftw_complex>(n / 2 + 1);
  const auto plan = planOf(n, real.get(), complex.get(), true);
  std::copy(signal.begin(), signal.end(), real.get());
  plan->forward(real.get(), complex.get());
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
  const auto plan = planOf(n, real.get(), complex.get(), false);
  for (std::size_t k = 0; k < spectrum.size(); ++k) {
    complex[k][0] = spectrum[k].real();
    complex[k][1] = spectrum[k].imag();
  }
  plan->backward(complex.get(), real.get());
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
