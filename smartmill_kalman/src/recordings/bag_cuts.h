#pragma once

#include <array>
#include <functional>
#include <string>
#include <vector>

#include "smartmill_core/modal/modal_model.h"
#include "smartmill_kalman/in_cut/cutting_frf.h"

namespace smartmill::kalman {

/// What of a bag is set against what.
struct BagCutsRequest {
  std::string path;
  bool tool = true;            ///< the tool's receptance; false: a force sensor's answer
  std::string response;        ///< topic of blocks with channels fx, fy, fz or, of the tool, x, y
  std::string spindle_sensor;  ///< smartmill-spindle-sensor/1 file, where the response is its six channels
  double length = 0.139;       ///< [m] of tool and holder, for it
  double force_error = 0.01;   ///< [1] deviation of force/compensated, as a share
};

/// Steady cuts of a bag, one stretch each, and the taps at rest that the same bag holds.
struct BagCuts {
  std::array<std::vector<CutSegment>, 3> axis;  ///< x, y, z; force/compensated drives
  std::array<ModalModel, 3> rest;               ///< tool/modes of the tool or of the sensor; empty: none
};

/// By stamps: samples between the controller's states on the line of full engagement, 0.1 s away from its
/// ends.
/// @throws Error naming what is missing, or not sampled together.
BagCuts cutsOfBag(const BagCutsRequest& request, const std::function<void(double)>& progress = {});

}  // namespace smartmill::kalman
