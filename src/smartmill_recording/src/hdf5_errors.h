#pragma once

#include <hdf5.h>

namespace smartmill::recording {

/// Keeps libhdf5 from printing its stack of errors, as long as it lives.
class Hdf5ErrorsOff {
 public:
  Hdf5ErrorsOff() {
    H5Eget_auto2(H5E_DEFAULT, &print_, &data_);
    H5Eset_auto2(H5E_DEFAULT, nullptr, nullptr);
  }
  ~Hdf5ErrorsOff() { H5Eset_auto2(H5E_DEFAULT, print_, data_); }
  Hdf5ErrorsOff(const Hdf5ErrorsOff&) = delete;
  Hdf5ErrorsOff& operator=(const Hdf5ErrorsOff&) = delete;

 private:
  H5E_auto2_t print_ = nullptr;
  void* data_ = nullptr;
};

}  // namespace smartmill::recording
