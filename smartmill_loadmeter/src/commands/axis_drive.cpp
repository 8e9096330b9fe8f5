#include "smartmill_loadmeter/motor/axis_drive.h"

#include <cstdio>
#include <map>
#include <string>
#include <vector>

#include "recordings/axis_moves.h"
#include "smartmill_core/axis_names.h"
#include "smartmill_core/campaign/campaign.h"
#include "smartmill_core/error.h"
#include "smartmill_loadmeter/commands.h"
#include "smartmill_recording/reading_progress.h"
#include "smartmill_recording/recording_file.h"

namespace {

using namespace smartmill;             // NOLINT
using namespace smartmill::loadmeter;  // NOLINT

struct Arguments {
  std::string source, axis;
  AxisDriveOptions options;
};

void print(const std::string& axis, std::size_t moves, const AxisDrive& d) {
  std::printf("axis %s: %zu moves, at most %.4g m/s and %.4g m/s2\n", axis.c_str(), moves, d.largest_velocity,
              d.largest_acceleration);
  std::printf("  inertia  %9.4f +- %.4f A s2/m\n", d.inertia.value, d.inertia.std_dev);
  std::printf("  Coulomb  %9.4f +- %.4f A\n", d.coulomb.value, d.coulomb.std_dev);
  std::printf("  viscous  %9.4f +- %.4f A s/m\n", d.viscous.value, d.viscous.std_dev);
  std::printf("  offset   %9.4f +- %.4f A\n", d.offset.value, d.offset.std_dev);
  std::printf("  residual %9.4f A RMS, %.2f %% of the variance explained\n", d.residual, 100.0 * d.explained);
}

void runCampaign(const Arguments& a) {
  const Campaign campaign = readCampaign(a.source);
  std::map<std::string, std::vector<AxisMotion>> moves;  // of each axis whose current was recorded
  for (const CampaignTest& test : campaign.tests) {
    if (test.kind != TestKind::move) continue;
    const Record record = readRecord(campaign, test);
    for (const std::string axis : AXIS_NAMES) {
      if ((a.axis.empty() || a.axis == axis) && record.has("current_" + axis))
        moves[axis].push_back(axisMotion(record, test.sample_rate, axis[0]));
    }
  }
  if (moves.empty())
    throw Error(a.source + ": no test of kind move has " +
                (a.axis.empty() ? "a column current_x[A], current_y[A] or current_z[A]"
                                : "the column current_" + a.axis + "[A]"));
  for (const auto& [axis, records] : moves)
    print(axis, records.size(), identifyAxisDrive(records, a.options));
}

// Without --axis, an axis whose moves do not determine its parameters is reported, the others are printed.
void runRecording(const Arguments& a) {
  AxisDriveRecorder recorder;
  const std::size_t moves = readAxisMoves(a.source, recorder, printReadingProgress);
  bool any = false;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    if (!a.axis.empty() && a.axis != AXIS_NAMES[axis]) continue;
    try {
      print(AXIS_NAMES[axis], moves, recorder.identify(axis, a.options));
      any = true;
    } catch (const Error& error) {
      if (!a.axis.empty()) throw Error(a.source + ": " + error.what());
      std::fprintf(stderr, "axis %s: %s\n", AXIS_NAMES[axis], error.what());
    }
  }
  if (!any) throw Error(a.source + ": expected moves in air of one axis or more in daq/servo");
}

void run(const Arguments& a) {
  if (isRecording(a.source)) {
    runRecording(a);
  } else {
    runCampaign(a);
  }
}

}  // namespace

namespace smartmill::loadmeter {

Command axisDriveCommand() {
  Command command("axis-drive", "identifies inertia and friction of feed drives from moves in air");
  command.description =
      "Current of each feed drive over acceleration and velocity, from the moves of a campaign or, in a "
      "recording "
      "of the graph, from the moves in air of a record of Servo Guide (daq/servo): inertia, Coulomb and "
      "viscous "
      "friction, offset.";
  command.examples = {{"measured/axis_motion", "all axes whose motor current was recorded"},
                      {"session.bag --axis x", "the moves in air of a session with servo_record:=true"}};
  command.files = {{"SOURCE",
                    "folder with campaign.yaml, records of kind move with axis_vx[mm/min] or axis_x[mm], and "
                    "current_x[A]; or a recording (bag, MCAP) with daq/servo"}};
  command.setBody(run, [](CommandLine& line, Arguments& a) {
    line.option("SOURCE", a.source, "campaign folder with tests of kind move, or a recording").required();
    line.option("--axis", a.axis, "x, y or z (default: all with a current)")
        .oneOf({AXIS_NAMES.begin(), AXIS_NAMES.end()});
    line.option("--smoothing", a.options.smoothing, "[s] window over velocity and current")
        .showDefault()
        .positive();
  });
  return command;
}

}  // namespace smartmill::loadmeter
