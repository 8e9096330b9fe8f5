#pragma once

#include <map>
#include <optional>
#include <string>
#include <vector>

#include "smartmill_core/cutting/tool.h"
#include "smartmill_core/model/machine_model.h"
#include "smartmill_core/signal/pulse_tachometer.h"

namespace smartmill {

/// A move: axes move and nothing cuts; the spindle may be at rest.
enum class TestKind { cut, air, tap, move };
/// As in campaign.yaml.
const char* testKindName(TestKind kind);

/// One test of a campaign (formats.md section 2), SI.
struct CampaignTest {
  std::string name;
  TestKind kind = TestKind::cut;
  std::string file;                             ///< relative to the campaign's folder
  std::string file_format;                      ///< empty: smartmill CSV; dynoware
  std::map<std::string, std::string> channels;  ///< dynoware: fx, fy, fz -> name in the file
  double sample_rate = 0.0;                     ///< [Hz]
  double spindle_speed = 0.0;                   ///< [rad/s]
  std::optional<Engagement> engagement;         ///< of a cut
  double feed_direction = 0.0;                  ///< [rad] of a cut: of its feed, from +x towards +y
  std::optional<double> engage_time;            ///< [s] absent: in cut throughout
  std::optional<double>
      running_before;  ///< [s] of a cut or air: time at these conditions before the record began
  std::optional<double> start_time;       ///< [s]
  std::optional<double> cut_time_before;  ///< [s]
  std::string direction;                  ///< of a tap: x, y or z
  /// [s] by which a group of columns (streamGroups()) is recorded later than the rest, where it is known.
  std::map<std::string, double> stream_offset;
  /// Column tachometer: readRecord() makes spindle_angle of its pulses.
  std::optional<PulseTachometerParameters> tachometer;
};

/// smartmill-campaign/1: a folder with campaign.yaml and one CSV a test.
struct Campaign {
  std::string folder;
  std::string model_file;  ///< as in the file, relative to the folder
  std::vector<CampaignTest> tests;

  std::string pathOf(const CampaignTest& test) const;  ///< of its record
  std::string modelPath() const;
};

/// @param path the folder or its campaign.yaml. @throws Error as readMachineModel().
Campaign readCampaign(const std::string& path);
/// Writes FOLDER/campaign.yaml. @throws Error.
void writeCampaign(const Campaign& campaign, const std::string& folder);

}  // namespace smartmill
