#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <string>
#include <vector>

#include "smartmill_core/cutting/tool.h"

namespace smartmill {

constexpr double NOT_A_NUMBER = std::numeric_limits<double>::quiet_NaN();

/// Evenly sampled channels from a data acquisition, 5..20 ms per block.
struct SampleBlock {
  double stamp = 0.0;                 ///< [s] time of the first sample
  double sample_rate = 0.0;           ///< [Hz]
  std::uint64_t first_index = 0;      ///< running index of the first sample; a jump means lost samples
  std::vector<std::string> channels;  ///< e.g. fx fy fz; hammer gap
  std::vector<std::string> units;     ///< SI unit of each channel
  std::vector<double> samples;        ///< interleaved: samples[i * channels.size() + c]

  std::size_t size() const { return channels.empty() ? 0 : samples.size() / channels.size(); }
  double at(std::size_t i, std::size_t c) const { return samples[i * channels.size() + c]; }
  double timeOf(std::size_t i) const { return stamp + static_cast<double>(i) / sample_rate; }  ///< [s]
  /// Index of a channel by name. @throws Error naming the channel and those present.
  std::size_t channel(const std::string& name) const;
  /// Samples of one channel. @throws Error as channel().
  std::vector<double> column(const std::string& name) const;
};

/// Sample of a tachometer or encoder.
struct SpindleAngle {
  double stamp = 0.0;  ///< [s]
  double angle = 0.0;  ///< [rad] of tooth 1, clockwise from +y
  double speed = 0.0;  ///< [rad/s]
};

/// Controller mode and state with the numbers of FOCAS (statinfo aut, run).
enum class CncMode : std::uint8_t {
  mdi = 0,
  mem = 1,
  edit = 3,
  handle = 4,
  jog = 5,
  inc = 8,
  reference = 9,
  dnc = 10
};
enum class CncRun : std::uint8_t { reset = 0, stop = 1, hold = 2, start = 3 };

struct CncState {
  double stamp = 0.0;  ///< [s]
  bool connected = false;
  bool armed = false;
  CncMode mode = CncMode::mdi;
  CncRun run = CncRun::reset;
  bool motion = false;
  bool emergency = false;
  bool alarm = false;
  std::string alarm_text;
  int program = 0;
  int sequence = 0;
  std::vector<std::string> axes;       ///< names, order of the fields below
  std::vector<double> position;        ///< [m] machine
  std::vector<double> distance_to_go;  ///< [m]
  double spindle_speed = 0.0;          ///< [rad/s]
  double feed = 0.0;                   ///< [m/s]
};

struct LoadSample {
  double stamp = 0.0;          ///< [s]
  double spindle_load = 0.0;   ///< [1] of full scale
  double spindle_speed = 0.0;  ///< [rad/s]
  std::vector<std::string> axes;
  std::vector<double> axis_load;  ///< [1] of rated
};

/// Present cutting condition (topic cut/condition).
struct CuttingCondition {
  enum class Kind : std::uint8_t { none = 0, air = 1, cut = 2, unsteady = 3 };
  double stamp = 0.0;  ///< [s] from which it is valid
  Kind kind = Kind::none;
  std::string name;
  std::string material;
  std::string tool_name;
  ToolGeometry tool;                      ///< smooth edges of one helix angle
  double cut_time_before = NOT_A_NUMBER;  ///< [s] time in the work of this tool before the stamp
  Engagement engagement;
  double spindle_speed = 0.0;                    ///< [rad/s] commanded
  std::array<double, 3> steady_from{{0, 0, 0}};  ///< [m] tool centre in the machine frame: from here ...
  std::array<double, 3> steady_to{{0, 0, 0}};  ///< [m] ... to here the tool is fully engaged at constant feed

  /// The tool is in the work, or may be.
  bool isInWork() const { return kind == Kind::cut || kind == Kind::unsteady; }
  /// Engagement, feed and speed are constant; in air the speed.
  bool isSteady() const { return kind == Kind::cut || kind == Kind::air; }
};

/// One block of force on the tool.
struct ForceBlock {
  enum class Status : std::uint8_t {
    measured = 0,
    compensated = 1,
    passed_through = 2,
    settling = 3,
    transient = 4,
    implausible = 5
  };
  double stamp = 0.0;                        ///< [s] of the first sample
  double sample_rate = 0.0;                  ///< [Hz]
  std::uint64_t first_index = 0;             ///< the sensor's running index
  std::array<std::vector<double>, 3> force;  ///< [N] x, y, z
  Status status = Status::measured;

  /// The sensor's dynamics are removed, if not as accurately in a transient.
  bool isCompensated() const { return status == Status::compensated || status == Status::transient; }
  /// No result about the size or the direction of the force is to be based on the block.
  bool isUnusable() const { return status == Status::settling || status == Status::implausible; }
};

}  // namespace smartmill
