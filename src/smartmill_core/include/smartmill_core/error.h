#pragma once

#include <stdexcept>
#include <string>

namespace smartmill {

/// What a user can mend: bad file, bad parameter, bad data. what() is one line that names what is wrong and
/// where.
class Error : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

}  // namespace smartmill
