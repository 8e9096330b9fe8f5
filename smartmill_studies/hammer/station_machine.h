#pragma once

#include <cstdint>
#include <deque>
#include <optional>
#include <random>
#include <string>
#include <vector>

#include "hammer/station_draw.h"
#include "smartmill_core/signal/streams.h"
#include "smartmill_hammer/sequence/hammer_sequence.h"
#include "smartmill_sim/world/hammer_station.h"

namespace smartmill::hammer {

/// Axes and spindle that move at constant speed after a latency, with the simulated hammer station: executes
/// the commands of a HammerSequence and returns its inputs.
class StationMachine {
 public:
  StationMachine(const DrawnStation& drawn, std::uint64_t seed);

  void obey(const Command& command);

  struct Streams {
    SampleBlock samples;
    SpindleAngle angle;
    CncState state;
  };
  /// Advances by 10 ms.
  void block(Streams& streams);

  double time() const { return time_; }        ///< [s]
  double closest() const { return closest_; }  ///< [m] smallest distance of the tool to the face of a sensor
  bool touched() const { return touched_; }    ///< a collision with a sensor
  double struckRetreat() const { return struck_; }  ///< [m] behind the cutting circle, largest of all hits
  int strikes() const { return strikes_; }
  int searchMoves() const { return search_moves_; }  ///< spindle moves before the first hit
  double restVolt() const { return rest_volt_; }     ///< [V] of the sensor at the command of the last hit

 private:
  void moveOn(double dt);
  void sample(Streams& streams);

  DrawnStation drawn_;
  sim::HammerStation station_;
  std::mt19937_64 random_;
  double time_ = 1000.0;
  std::uint64_t index_ = 7000;
  Axes3 position_{{0.0, 0.0, 0.15}};
  double spindle_ = 0.4, spindle_speed_ = 0.0;
  std::deque<Waypoint> path_;
  double path_from_ = 0.0, orient_from_ = 0.0, orient_to_ = 0.0;
  bool orienting_ = false;
  double closest_ = 1.0, struck_ = 0.0;
  bool touched_ = false;
  int strikes_ = 0, search_moves_ = 0;
  double rest_volt_ = 0.0, volt_ = 0.0;
};

/// Inputs of the sequence: the tool as stated by the operator and the catalogue, the sensor as stated by its
/// set-up.
struct StationTask {
  HammerParameters parameters;
  MeasureFrfGoal goal;
};
/// The request without the stick-out.
MeasureFrfGoal goalOf(const DrawnStation& drawn, int hits);
StationTask taskOf(const DrawnStation& drawn, int hits);

/// Runs a complete measurement. @param seconds [s] its duration in machine time
MeasureFrfResult measure(StationMachine& machine, const HammerParameters& parameters,
                         const MachineModel& believed, const MeasureFrfGoal& goal, double& seconds);

}  // namespace smartmill::hammer
