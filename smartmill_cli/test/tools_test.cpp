// The command of the program and the tool of the same code do the same to the byte: output, exit code, files.

#include <fstream>
#include <regex>
#include <set>

#include <gmock/gmock.h>

#include "shell.h"
#include "simulated_session.h"
#include "smartmill_cli/commands.h"
#include "smartmill_core/campaign/campaign.h"
#include "smartmill_core/testing/shared_data.h"

namespace smartmill {
namespace {

using ::testing::HasSubstr;

/// Commands that were compared with their tool.
std::set<std::string>& compared() {
  static std::set<std::string> commands;
  return commands;
}

/// The program of a command's old name.
std::string toolOf(const std::string& command) {
  compared().insert(command);
  std::istringstream tools(TOOLS);
  for (std::string tool; std::getline(tools, tool, ' ');)
    if (tool.rfind(command + "=", 0) == 0) return tool.substr(command.size() + 1);
  ADD_FAILURE() << "no tool of command " << command;
  return "false";
}

/// Without wall times and folders: "seconds" in report.json; their sum, their column and the path of the
/// model in report.html; the speed of compensate.
std::string withoutTimes(const std::string& file, std::string text) {
  if (file.empty()) text = std::regex_replace(text, std::regex("in [0-9.]+ s, [0-9]+ x real time"), "");
  if (file.find("report.json") != std::string::npos)
    text = std::regex_replace(text, std::regex("\"seconds\": [-+.e0-9]+"), "\"seconds\"");
  if (file.find("report.html") != std::string::npos) {
    text = std::regex_replace(text, std::regex("It took [0-9]+ s"), "");
    text = std::regex_replace(text, std::regex("(model|folder):=[^ <]+"), "");
    text = std::regex_replace(text, std::regex("<td>[0-9]+<td>[0-9]+\\.[0-9]</tr>"), "");
  }
  return text;
}

void expectSame(const std::string& command, const std::string& arguments, int code = 0) {
  const Outcome old = shell(toolOf(command) + " " + arguments);
  const Outcome now = shell(SMARTMILL " " + command + " " + arguments);
  EXPECT_EQ(now.code, code) << command << " " << arguments << "\n" << now.error;
  EXPECT_EQ(old.code, code) << command << " " << arguments << "\n" << old.error;
  EXPECT_EQ(withoutTimes("", now.out), withoutTimes("", old.out)) << command << " " << arguments;
  ASSERT_EQ(now.files.size(), old.files.size()) << command << " " << arguments;
  for (const auto& [name, content] : now.files) {
    ASSERT_EQ(old.files.count(name), 1u) << command << ": " << name;
    EXPECT_TRUE(withoutTimes(name, content) == withoutTimes(name, old.files.at(name)))
        << command << " " << arguments << ": " << name << " differs";
  }
}

/// The air cuts of a campaign: a search through them takes a second.
std::string airCuts(const std::string& from, const TemporaryFolder& to) {
  Campaign campaign = readCampaign(from);
  std::vector<CampaignTest> air;
  for (const CampaignTest& test : campaign.tests) {
    if (test.kind != TestKind::air) continue;
    std::filesystem::copy_file(from + "/" + test.file, to.file(test.file));
    air.push_back(test);
  }
  campaign.tests = air;
  std::filesystem::copy_file(campaign.modelPath(), to.file("model.yaml"));
  campaign.model_file = "model.yaml";
  writeCampaign(campaign, to.file("."));
  return to.file(".");
}

TEST(Tools, DoWhatTheirCommandsDoToACampaign) {
  SMARTMILL_SHARED_DATA(campaign, "campaigns/none");
  const std::string model = campaign + "/model.yaml";
  expectSame("gap", campaign);
  expectSame("simulate", model + " " + campaign + " -o out --seed 3");
  expectSame("hide", model + " -o hidden.yaml --seed 7");
  expectSame("compensate", campaign + " --identify -o out");
  expectSame("cutting-frf", campaign + " --of sensor --speed-width-percent 40 --no-picture -o out");
  expectSame("coefficients", campaign + " --source force --means revolutions -o cutting.yaml");
  expectSame("coefficients", campaign + " --source load_meter");
  expectSame("force-law", campaign + " --curve curve.yaml");
  expectSame("calibrate", campaign);
  expectSame("plan-cuts", model +
                              " --speeds 3000 6000 --feeds 0.05 0.1 0.2 --depths 0.5 1 --ktc-std 100 "
                              "--kte-std 5 --torque 10 --power 5000");
}

TEST(Tools, DoWhatTheirCommandsDoToMeasuredRecords) {
  SMARTMILL_SHARED_DATA(hits, "measured/five_hits");
  SMARTMILL_SHARED_DATA(sound, "measured/sound_mill/chatter.wav");
  SMARTMILL_SHARED_DATA(taps, "campaigns/cross_talk");
  SMARTMILL_SHARED_DATA(moves, "measured/axis_motion");
  expectSame("axis-drive", moves);
  expectSame("daq", "nowhere.yaml", 1);  // its output has times
  expectSame("align", "nowhere.bag daq/hammer/hammer daq/dynamometer/fz", 1);
  expectSame("sensitivity", "nowhere.yaml daq/vibration x nowhere.bag --exciter 10", 1);
  expectSame("frf", hits + "/*.csv -o out --no-picture");
  expectSame("detect", sound + " --speed 8018 --teeth 4 -o picture.png");
  expectSame("next-speed", "--teeth 4 --speeds 6000:18000 9000=1050 14800=stable");
  expectSame("next-speed", "--teeth 4 --speeds 6000:18000 9000=stable", 1);
  expectSame("sensor-report", taps + " -o matrix.csv");
}

TEST(Tools, DoWhatTheirCommandsDoToAModel) {
  const std::string cut = " " MODEL " --entry-deg 0 --exit-deg 180 ";
  expectSame("lobes", cut + "--speeds 4000:6000:11 --max-depth-mm 2 -o chart.csv");
  expectSame("lobes", cut + "--speeds 4000:6000:11 --max-depth-mm 0 -o chart.csv", 1);
  expectSame("chatter-probability", cut + "--speeds 4000:6000:5 --depths-mm 0.1:1:3 --draws 3 -o grid.csv");
  expectSame("lobes", " " MODEL
                      " --entry-deg 150 --exit-deg 180 --speeds 4000:6000:5 --max-depth-mm 2 -o chart.csv "
                      "--surface-error walls.csv --feed-mm 0.05 --tolerance-um 10");
  expectSame("tool-frf", "nowhere.yaml --tool em12 -o tip", 1);
  const TemporaryFolder folder;
  const std::string two = "rpm,depth_mm,verdict\n3000,0.1,stable\n3000,0.3,chatter\n";
  const std::string probing =
      "--teeth 4 --diameter-mm 12 --entry-deg 0 --exit-deg 180 --speeds 600:4000 --max-depth-mm 1 --cuts " +
      folder.write("two_cuts.csv", two);
  expectSame("lobes-from-cuts", probing + " -o chart.csv");
  expectSame("lobes-from-cuts", probing + " --risk 0", 1);
  const std::string four = folder.write("four_cuts.csv", two + "900,0.15,stable\n900,0.3,chatter\n");
  expectSame("process-damping", cut + "--cuts " + four + " -o damped.yaml");
}

TEST(Tools, DoWhatTheirCommandsDoToANcProgram) {
  const TemporaryFolder folder;
  const std::string good =
      folder.write("part.nc", "G21 G90 G0 X-10 Y10 Z-2\nS6000 M3\nG1 X30 F1200\nG0 Z5\nM30\n");
  const std::string options = " --stock-mm 40 20 10 --model " MODEL " -o part";
  expectSame("program", good + options);
  expectSame("program", folder.write("bad.nc", "G41 X1\nM30\n") + options, 1);
}

TEST(Tools, DoWhatTheirCommandsDoToADatabase) {
  SMARTMILL_SHARED_DATA(campaign, "campaigns/none");
  const auto filledAndAsked = [&](const std::string& coefficients, const std::string& database) {
    std::string lines =
        coefficients + " " + campaign + " --source force --database d.sqlite --tool mill --material steel\n";
    for (const char* query :
         {"list", "find --tool mill --material steel", "export all.csv", "health",
          "answer --tool mill --material brass", "predict --material steel --rake 5 --helix 30"}) {
      lines += database + " d.sqlite " + query + "\necho '" + query + "': exit code $?\n";
    }
    return shell(lines);
  };
  const Outcome old = filledAndAsked(toolOf("coefficients"), toolOf("database")),
                now = filledAndAsked(SMARTMILL " coefficients", SMARTMILL " database");
  EXPECT_EQ(now.out, old.out);
  EXPECT_TRUE(now.files == old.files);
}

TEST(Tools, DoWhatTheirCommandsDoWithASpindleSensor) {
  const TemporaryFolder folder;
  const std::string table =
      folder.write("record.csv",
                   "test,time[s],length[mm],load_x[N],load_y[N],load_z[N],x1[N],x2[N],y1[N],"
                   "y2[N],z1[N],z2[N]\n"
                   "1,0,130,0,0,0,1,-1,2,-2,3,3\n"
                   "1,0.001,130,0,0,0,2,-2,1,-1,2,2\n");
  expectSame("spindle-sensor", "apply " SENSOR_FILE " " + table + " -o forces.csv");
  expectSame("spindle-sensor", "apply nowhere.yaml nowhere.csv -o forces.csv", 1);
}

TEST(Tools, DoWhatTheirCommandsDoWithAController) {
  expectSame("capture", "127.0.0.1 --port 1 --timeout 0.2", 1);
  expectSame("fetch-program", "127.0.0.1 --port 1 --timeout 0.2 -o part.nc", 1);
  // Until Ctrl-C. Each run has a port of its own.
  const auto controller = [](const std::string& program) {
    return shell("set -m; timeout -s KILL 60 " + program +
                 " --port 0 --mode dnc >started & process=$!\n"
                 "for _ in $(seq 1000); do grep -q listens started && break; sleep 0.05; done\n"
                 "kill -INT -- -$process; wait $process; code=$?\n"
                 "sed 's/:[0-9]*,/:PORT,/' started; rm started; exit $code");
  };
  const Outcome old = controller(toolOf("controller")), now = controller(SMARTMILL " controller");
  EXPECT_EQ(now.code, 0) << now.error;
  EXPECT_EQ(old.code, 0) << old.error;
  EXPECT_THAT(now.out, HasSubstr("127.0.0.1:PORT, mode dnc"));
  EXPECT_EQ(now.out, old.out);
}

TEST(Tools, DoWhatTheirCommandsDoToARecording) {
  const TemporaryFolder folder;
  const std::string bag = folder.file("monday.bag"), later = folder.file("friday.mcap");
  const MachineModel mill = readMachineModel(MILL);
  for (const std::string& path : {bag, later}) {
    SimulatedSession session(path, mill, path == bag ? 1000.0 : 400000.0);
    session.results();
    for (const double rpm : {3000.0, 6000.0, 9000.0}) session.air("air_" + std::to_string(rpm), rpm);
    for (const double feed : {4e-5, 8e-5, 1.2e-4})
      session.slot("slot_" + std::to_string(feed), 4500.0, feed, 5e-4);
    session.close();
  }
  const std::string with_model = " --model " MILL;
  expectSame("campaign", bag + with_model + " -o out");
  expectSame("convert", bag + " -o out.mcap --compression zstd");
  expectSame("convert", later + " -o out.bag");
  expectSame("export", bag + " -o out.h5 --name force/compensated --to 5");
  expectSame("account", bag);
  expectSame("items", bag + " -o out");
  expectSame("compensate", bag + with_model + " -o out");
  expectSame("compensate", later + with_model + " -o out");
  expectSame("coefficients", bag + with_model + " -o cutting.yaml");
  expectSame("coefficients", later + with_model);
  expectSame("force-law", later + " --curve curve.yaml");
  expectSame("health", bag + " " + later + " -o health.csv");
  expectSame("chart", bag + with_model + " -o chart.csv --states states.csv");
  expectSame("detect", later + " --speed 4500 --teeth 4");
  expectSame("cutting-frf", bag + " -o out", 1);  // no displacement was recorded
}

// The recording of ./run, by the graph.
TEST(Tools, DoWhatTheirCommandsDoToTheSessionOfTheJob) {
  const std::string bag = RESULTS "/session.bag";
  if (!std::filesystem::exists(bag)) GTEST_SKIP() << bag << " is missing: ./run records it";
  const std::string with_model = " --model " MILL;
  expectSame("frf", bag + with_model + " -o out --no-picture");
  expectSame("compensate", bag + with_model + " -o out");
  expectSame("coefficients", bag + with_model);
  expectSame("force-law", bag + " --curve curve.yaml");
  expectSame("chart", bag + with_model + " -o chart.csv");
  expectSame("health", bag + " " + bag);
  expectSame("campaign", bag + with_model + " -o out");
}

// The search itself, in a campaign of air cuts.
TEST(Tools, ExplainWhatTheirCommandExplains) {
  SMARTMILL_SHARED_DATA(campaign, "campaigns/stribeck_friction");
  const TemporaryFolder folder;
  expectSame("explain", airCuts(campaign, folder) + " -o out --threads 1");
}

TEST(Tools, ExplainARecordingAsTheirCommandDoes) {
  const TemporaryFolder folder;
  const std::string mcap = folder.file("air.mcap");
  SimulatedSession session(mcap, readMachineModel(MILL));
  for (const double rpm : {3000.0, 9000.0}) session.air("air_" + std::to_string(rpm), rpm);
  session.close();
  expectSame("explain", mcap + " --model " MILL " -o out --threads 1");
}

// Ctrl-C ends the search; what was found until then is in the report.
TEST(Explain, EndsWithItsReportWhenItIsInterrupted) {
  SMARTMILL_SHARED_DATA(campaign, "campaigns/stribeck_friction");
  // Once the search has said something, it listens to Ctrl-C.
  const Outcome ended =
      shell(std::string("set -m; " SMARTMILL " explain ") + campaign +
            " -o out 2>progress & process=$!\n"
            "for _ in $(seq 600); do grep -q 's\\]' progress && break; sleep 0.05; done\n"
            "sleep 0.2; kill -INT $process; wait $process; code=$?; cat progress >&2; exit $code");
  EXPECT_EQ(ended.code, 130) << ended.error;
  EXPECT_THAT(ended.error, HasSubstr("cancelled"));
  EXPECT_EQ(ended.files.count("out/report.json"), 1u);
  EXPECT_EQ(ended.files.count("out/report.html"), 1u);
  EXPECT_EQ(ended.files.count("out/model.yaml"), 1u);
  EXPECT_THAT(ended.files.at("out/report.json"), HasSubstr("\"interrupted\": true"));
}

/// After all tests: none of the program's commands was left out.
class EveryCommand : public ::testing::Environment {
 public:
  void TearDown() override {
    const ::testing::UnitTest& tests = *::testing::UnitTest::GetInstance();
    if (tests.test_to_run_count() != tests.total_test_count()) return;  // a filter
    if (sharedData("campaigns/none").empty()) return;
    for (const CommandTopic& topic : smartmillProgram().topics)
      for (const Command& command : topic.commands)
        EXPECT_EQ(compared().count(command.name), 1u) << command.name << " was not compared with its tool";
  }
};
const ::testing::Environment* const EVERY_COMMAND = ::testing::AddGlobalTestEnvironment(new EveryCommand);

}  // namespace
}  // namespace smartmill
