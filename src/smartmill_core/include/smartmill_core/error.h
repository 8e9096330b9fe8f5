#pragma once

#include <stdexcept>
#include <string>

namespace smartmill {

/// An error that the user can correct: bad file, parameter or data. what() is one line that states what is
/// wrong and where.
class Error : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

}  // namespace smartmill
