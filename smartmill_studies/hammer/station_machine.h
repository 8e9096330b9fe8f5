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

/// Axes and spindle that move at constant speed after a latency, before the simulator's hammer station: what
/// a HammerSequence commands and hears.
class StationMachine {
 public:
  StationMachine(const DrawnStation& drawn, std::uint64_t seed);

  void obey(const Command& command);

  struct Streams {
    SampleBlock samples;
    SpindleAngle angle;
    CncState state;
  };
  /// The next 10 ms.
  void block(Streams& streams);

  double time() const { return time_; }             ///< [s]
  double closest() const { return closest_; }       ///< [m] of the tool to a sensor's face, ever
  bool touched() const { return touched_; }         ///< a collision with a sensor
  double struckRetreat() const { return struck_; }  ///< [m] behind the cutting circle, largest over the blows
  int strikes() const { return strikes_; }
  int searchMoves() const { return search_moves_; }  ///< of the spindle before the first blow
  double restVolt() const { return rest_volt_; }     ///< [V] of the sensor when the last blow was asked for

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

/// What the sequence is told, and what it is asked for: the tool as the operator and the catalogue tell it,
/// the sensor as whoever set it up.
struct StationTask {
  HammerParameters parameters;
  MeasureFrfGoal goal;
};
/// What is asked for, without the stick-out.
MeasureFrfGoal goalOf(const DrawnStation& drawn, int hits);
StationTask taskOf(const DrawnStation& drawn, int hits);

/// A whole measurement. @param seconds [s] of machine time it took
MeasureFrfResult measure(StationMachine& machine, const HammerParameters& parameters,
                         const MachineModel& believed, const MeasureFrfGoal& goal, double& seconds);

}  // namespace smartmill::hammer
