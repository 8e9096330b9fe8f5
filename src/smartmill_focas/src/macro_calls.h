#pragma once

#include <optional>

#include "smartmill_focas/controller_interface.h"

namespace smartmill::focas {

/// Answers the requests that read and write macro variables.
class MacroCalls {
 public:
  explicit MacroCalls(MacroInterface& controller) : controller_(controller) {}

  /// @return EwCode; nullopt: another request. @throws WireError on malformed arguments
  std::optional<int> call(const SubRequest& request, Writer& out);

 private:
  int read(const SubRequest& request, Writer& out) const;
  int write(const SubRequest& request);
  int readDoubles(const SubRequest& request, Writer& out) const;
  int writeDoubles(const SubRequest& request);

  MacroInterface& controller_;
};

}  // namespace smartmill::focas
