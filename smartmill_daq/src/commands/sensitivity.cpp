#include <algorithm>
#include <cmath>
#include <cstdio>
#include <string>
#include <vector>

#include "smartmill_core/error.h"
#include "smartmill_core/formatted.h"
#include "smartmill_daq/calibration/sensitivity.h"
#include "smartmill_daq/commands.h"
#include "smartmill_daq/instrument/instrument.h"
#include "smartmill_recording/recording_reader.h"

namespace smartmill::daq {
namespace {

struct Arguments {
  std::string config, topic, channel, record, empty, accelerometer, date;
  double exciter = 0.0, frequency = EXCITER_FREQUENCY, mass = 0.0, gravity = STANDARD_GRAVITY,
         reference_std = 0.0;
  bool write = false, upwards = false;
};

struct Samples {
  std::vector<double> values;
  double rate = 0.0;  // [Hz]
};

Samples samplesOf(const std::string& file, const std::string& topic, const std::string& channel) {
  Samples samples;
  RecordingReader reader(file);
  if (!reader.has(topic)) throw Error(file + ": no topic " + topic);
  reader.on<SampleBlock>(topic, [&](const SampleBlock& block, double) {
    const std::vector<double> column = block.column(channel);
    samples.values.insert(samples.values.end(), column.begin(), column.end());
    samples.rate = block.sample_rate;
  });
  reader.run();
  if (samples.values.empty()) throw Error(file + ": no samples on " + topic);
  return samples;
}

ReadingRatio ratioBy(const Arguments& arguments) {
  const int methods = (arguments.exciter > 0.0) + !arguments.empty.empty() + !arguments.accelerometer.empty();
  if (methods != 1) throw Error("expected one of --exciter, --empty and --accelerometer");
  const Samples samples = samplesOf(arguments.record, arguments.topic, arguments.channel);
  if (arguments.exciter > 0.0)
    return ratioByExciter(samples.values, samples.rate, arguments.frequency, arguments.exciter);
  if (!(arguments.mass > 0.0)) throw Error("--mass: expected the mass in kg");
  if (!arguments.empty.empty()) {
    const double force = (arguments.upwards ? -1.0 : 1.0) * arguments.mass * arguments.gravity;
    return ratioByMass(samplesOf(arguments.empty, arguments.topic, arguments.channel).values, samples.values,
                       force);
  }
  const std::size_t slash = arguments.accelerometer.rfind('/');
  if (slash == std::string::npos) throw Error("--accelerometer: expected TOPIC/CHANNEL");
  const Samples acceleration = samplesOf(arguments.record, arguments.accelerometer.substr(0, slash),
                                         arguments.accelerometer.substr(slash + 1));
  if (acceleration.rate != samples.rate) throw Error("--accelerometer: expected the same sample rate");
  return ratioByHits(samples.values, acceleration.values, samples.rate, arguments.mass);
}

void run(const Arguments& arguments) {
  const Channel channel = readChannel(arguments.config, arguments.topic, arguments.channel);
  const ReadingRatio ratio = ratioBy(arguments);
  const NewSensitivity sensitivity = sensitivityOf(channel, ratio, arguments.reference_std);
  std::printf("%s\n", sensitivityText(channel.name, sensitivity).c_str());
  if (!arguments.write) return;
  storeSensitivity(arguments.config, arguments.topic, arguments.channel, sensitivity.value,
                   sensitivity.std_dev, arguments.date.empty() ? today() : arguments.date);
  std::printf("stored in %s\n", arguments.config.c_str());
}

}  // namespace

Command sensitivityCommand() {
  Command command("sensitivity", "sensitivity of a sensor's channel, from a known acceleration, mass or hit");
  command.description =
      "Compares a record of `smartmill daq` with a known quantity and states the right sensitivity of the "
      "channel "
      "in the instrument file, with its standard deviation: an accelerometer on a handheld exciter, a force "
      "sensor "
      "under a known mass, a hammer on a freely hanging mass with a calibrated accelerometer.";
  command.examples = {
      {"front_end.yaml daq/vibration x exciter.bag --exciter 10 --write", "10 m/s2 RMS at 159.2 Hz"},
      {"front_end.yaml daq/dynamometer fz loaded.bag --empty empty.bag --mass 10", "10 kg along the channel"},
      {"front_end.yaml daq/hammer hammer hits.bag --accelerometer daq/vibration/x --mass 1.02",
       "F = m a of each hit"}};
  command.files = {
      {"CONFIG", "with --write: sensitivity, sensitivity_std and sensitivity_date of the channel"}};
  command.setBody(run, [](CommandLine& line, Arguments& arguments) {
    line.option("CONFIG", arguments.config, "instrument file (smartmill-instrument/1)").required();
    line.option("TOPIC", arguments.topic, "of the stream in it, daq/...").required();
    line.option("CHANNEL", arguments.channel, "its name").required();
    line.option("RECORD", arguments.record, "bag or MCAP file, recorded with this instrument file")
        .required();
    line.option("--exciter", arguments.exciter, "effective value of the exciter, in the unit of the channel")
        .notNegative();
    line.option("--frequency", arguments.frequency, "[Hz] of the exciter").positive().showDefault();
    line.option("--empty", arguments.empty, "record without the mass, which is on the sensor in RECORD");
    line.option("--mass", arguments.mass, "[kg] on the sensor, or hit, with the accelerometer").notNegative();
    line.flag("--against", arguments.upwards, "the mass acts against the channel's direction");
    line.option("--gravity", arguments.gravity, "[m/s2] at this place").positive().showDefault();
    line.option("--accelerometer", arguments.accelerometer,
                "TOPIC/CHANNEL of the mass's acceleration [m/s2]");
    line.option("--reference-std", arguments.reference_std,
                "[1] relative standard deviation of exciter, mass or accelerometer")
        .notNegative()
        .showDefault();
    line.flag("--write", arguments.write, "stores the sensitivity in CONFIG");
    line.option("--date", arguments.date, "YYYY-MM-DD of the record; today by default");
  });
  return command;
}

}  // namespace smartmill::daq
