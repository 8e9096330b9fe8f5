#pragma once

#include <array>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "smartmill_core/cutting/tool.h"
#include "smartmill_core/model/machine_model.h"
#include "smartmill_core/signal/pulse_tachometer.h"

namespace smartmill {

/// A move: axes move and nothing cuts; the spindle may be at rest. A path: an NC program machines a part.
enum class TestKind { cut, air, tap, move, path };
/// As in campaign.yaml.
const char* testKindName(TestKind kind);

/// The NC program that a test of kind path runs, in the stock of the model's workpiece.
struct PathProgram {
  std::string file;                  ///< relative to the campaign's folder
  bool linuxcnc = false;             ///< its dialect is LinuxCNC's, else Fanuc's
  std::array<double, 3> zero{};      ///< [m] machine position at which the tip of the tool is at its zero
  std::map<int, std::string> tools;  ///< model files, relative to the folder, by tool number (T); empty: the
                                     ///< campaign's model describes the only tool
};

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
  std::optional<PathProgram> program;     ///< of a path
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

  std::string pathOf(const CampaignTest& test) const;   ///< of its record
  std::string inFolder(const std::string& file) const;  ///< path of a file of the campaign
  std::string modelPath() const;
};

/// @param path the folder or its campaign.yaml. @throws Error as readMachineModel(), and on a test of kind
/// path, which has no constant engagement: its steady cuts are to be found first.
Campaign readCampaign(const std::string& path);
/// The same for a reader that accepts tests of kind path.
Campaign readCampaignWithPaths(const std::string& path);
bool hasPaths(const Campaign& campaign);
/// Writes FOLDER/campaign.yaml. @throws Error.
void writeCampaign(const Campaign& campaign, const std::string& folder);

}  // namespace smartmill
