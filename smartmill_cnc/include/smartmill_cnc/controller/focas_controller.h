#pragma once

#include <memory>
#include <string>

#include "smartmill_cnc/controller/controller.h"

namespace smartmill::cnc {

struct FocasParameters {
  std::string host = "127.0.0.1";  ///< controller
  int port = 8193;                 ///< [-] 1..65535
  double reply_timeout = 0.5;      ///< [s] for connecting and for every answer
  int spindle = 1;                 ///< [-] 1-based
  int marker_macro = 100;          ///< [-] variable that tells the end of a piece of program
  int orient_macro = 1133;         ///< [-] variable that M119 reads the angle from

  /// @throws Error naming key and value.
  void validate() const;
};

/// A Fanuc controller over FOCAS2 Ethernet. A program goes to it as a piece of one long DNC session: its
/// text, then #marker=k; all of it has been executed when the variable is set (Dunwoody 6.2 and 7.1).
/// @throws Error of FocasParameters::validate().
std::unique_ptr<Controller> makeFocasController(const FocasParameters& parameters);

}  // namespace smartmill::cnc
