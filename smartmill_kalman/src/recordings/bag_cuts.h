#pragma once

#include <array>
#include <functional>
#include <string>
#include <vector>

#include "smartmill_core/modal/modal_model.h"
#include "smartmill_kalman/in_cut/cutting_frf.h"

namespace smartmill::kalman {

/// Selection of excitation and response in a bag.
struct BagCutsRequest {
  std::string path;
  bool tool = true;            ///< receptance of the tool; false: FRF of a force sensor
  std::string response;        ///< topic of blocks with channels fx, fy, fz or, of the tool, x, y
  std::string spindle_sensor;  ///< smartmill-spindle-sensor/1 file, where the response is its six channels
  double length = 0.139;       ///< [m] of tool and holder, for it
  double force_error = 0.01;   ///< [1] relative standard deviation of force/compensated
  double settling = 0.1;       ///< [s] less at each end of full engagement: stamps of the controller are late
  double path_tolerance = 1e-3;  ///< [m] off the line of full engagement
  double maximum_gap = 0.2;  ///< [s] between states of the controller; after a longer one it may have moved
  double together = 0.02;    ///< [1] of the sample's time, by which force and response may be sampled apart
};

/// Steady cuts of a bag, one segment each, and the taps at rest in the same bag.
struct BagCuts {
  std::array<std::vector<CutSegment>, 3> axis;  ///< x, y, z; excited by force/compensated
  std::array<ModalModel, 3> rest;               ///< tool/modes of the tool or of the sensor; empty: none
};

/// A segment contains the samples between controller states on the line of full engagement, less the settling
/// time at each end.
/// @throws Error when a topic is missing or the streams are not sampled together.
BagCuts cutsOfBag(const BagCutsRequest& request, const std::function<void(double)>& progress = {});

}  // namespace smartmill::kalman
