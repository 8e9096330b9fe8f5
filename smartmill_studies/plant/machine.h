#pragma once

#include <array>
#include <optional>
#include <random>
#include <string>
#include <vector>

#include "plant/beam.h"
#include "plant/plate.h"
#include "smartmill_core/campaign/campaign.h"
#include "smartmill_core/campaign/record.h"
#include "smartmill_core/model/machine_model.h"

namespace smartmill::plant {

/// A cause that the catalogue of effects does not list.
struct Outside {
  std::string kind;     ///< one of outsideKinds()
  std::string channel;  ///< fx, fy, fz of those that act on a channel
  double size = 0.0;    ///< [N] on a channel, else [1]
  double place = 0.0;   ///< [Hz], order, [s] or [m], depending on the kind
  double width = 0.0;   ///< [m] of hard_spot and hardness_wave
};

/// tone (place [Hz]), settling (place [s]) and half_order on a channel; bursts (place [s] between them);
/// curve: a channel reads f (1 + size |f| / 1 kN); kink: specific force falls by size above a chip of place
/// [m]; softer_with_time: chip coefficients 1 + size exp(-t / place) from engagement; hard_skin: the
/// uppermost place [m] of the depth has coefficients 1 + size; lost_corner: the lowest place [m] of one
/// tooth's edge is missing.
const std::vector<std::string>& outsideKinds();
/// Kinds that the bench draws on request only. Factors on all coefficients at a path x along the feed since
/// engagement: hard_spot, 1 + size exp(-((x - place) / width)^2 / 2); hardness_wave,
/// 1 + size sin(2 pi (x - place) / width); hardness_slope, exp(size x / 1 mm). Zero of a channel at a time t
/// since the machine was cold: zero_drift, size t / 1 min; zero_approach, size (1 - exp(-t / place));
/// zero_step, size from place on; zero_of_record, size times a normal number in each record.
const std::vector<std::string>& requestedOutsideKinds();

/// Small imperfections of real machines that no model contains.
struct Unsteadiness {
  double coefficient_scatter = 0.0;  ///< [1] of the chip coefficients from revolution to revolution
  double speed_ripple = 0.0;         ///< [1] of the spindle's speed, at a frequency of its own
  double noise_colour = 0.0;         ///< [1] share of the noise's power below 300 Hz (first order)
};

/// An independent milling machine with measurement. It shares file formats with the product but no physics:
/// chips are cut from polygons (front.h), structures follow the recurrence of Nigam and Jennings, the tool
/// may be a beam (beam.h), the sensor a plate (plate.h).
struct Plant {
  ToolGeometry tool;
  CuttingCoefficients cutting;
  std::array<std::vector<PointMode>, 2> tip;  ///< of the tool, along x and y
  std::vector<SensorMode> sensor;
  std::array<double, 3> sensor_direct{{1, 1, 1}};  ///< [1] passes without dynamics
  std::array<double, 3> noise_rms{{1, 1, 1}};      ///< [N]
  double load_meter_noise = 2e-4;                  ///< [V] before rounding
  double tip_noise = 5e-8;                         ///< [m]
  std::optional<Spindle> spindle;
  Unsteadiness unsteadiness;
  std::vector<EffectEntry> effects;  ///< of the catalogue, implemented independently of the twin
  std::optional<Outside> outside;
};

/// A plant equal to a model, for comparison with other programs.
Plant plantOf(const MachineModel& model);

struct RunOptions {
  int steps = 8;                ///< a sample
  double slice = 0.1e-3;        ///< [m] height of the tool's slices
  bool show_angle = true;       ///< column spindle_angle
  bool show_tip = false;        ///< columns tool_x, tool_y
  std::optional<double> phase;  ///< [rad] of the spindle at time 0; absent: drawn
  bool noise = true;
};

/// Length of a record of a kind [samples]. In a move each axis travels forward and back in turn with the
/// spindle stopped.
std::size_t samplesOf(const CampaignTest& test);

/// Runs one test. @return its record
Record run(const Plant& plant, const CampaignTest& test, const RunOptions& options, std::mt19937_64& random);

}  // namespace smartmill::plant
