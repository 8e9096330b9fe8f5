#include "smartmill_daq/setup/instrument_setup.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <filesystem>
#include <system_error>
#include <utility>

#include "smartmill_core/formatted.h"
#include "smartmill_core/io/text_file.h"
#include "smartmill_daq/alignment/stream_alignment.h"
#include "smartmill_daq/instrument/instrument.h"

namespace smartmill::daq {
namespace {

namespace fs = std::filesystem;

constexpr const char* ENDING = ".yaml";
constexpr const char* TRIED = ".tried";  // a description that is not stored; next to the others, since paths
                                         // in it are relative to its folder
constexpr std::size_t LONGEST_NAME = 60, LONGEST_TEXT = 100000;  // [byte]
constexpr double LONGEST_TRIAL = 10.0, LONGEST_RECORD = 60.0;    // [s]

/// A description as a file of its own, for as long as it is looked at.
class TriedFile {
 public:
  TriedFile(const std::string& folder, const std::string& text) : path_(folder + "/" + TRIED) {
    if (text.size() > LONGEST_TEXT) throw Error("instrument: longer than 100000 characters");
    writeText(path_, text);
  }
  TriedFile(const TriedFile&) = delete;
  TriedFile& operator=(const TriedFile&) = delete;
  ~TriedFile() {
    std::error_code failed;
    fs::remove(path_, failed);
  }
  const std::string& path() const { return path_; }

  /// A message about the description, without the name that only this file has.
  std::string named(std::string text) const {
    for (std::size_t at = text.find(path_); at != std::string::npos; at = text.find(path_))
      text.replace(at, path_.size(), "instrument");
    return text;
  }

 private:
  std::string path_;
};

void requireSeconds(double seconds, double most) {
  if (!(seconds > 0.0 && seconds <= most))
    throw Error(formatted("seconds: %g, expected up to %g", seconds, most));
}

const TriedChannel& find(const Trial& trial, const std::string& topic, const std::string& channel) {
  for (const TriedChannel& tried : trial.channels)
    if (tried.topic == topic && tried.channel.name == channel) return tried;
  throw Error("no channel " + topic + "/" + channel + ", expected one of the instrument");
}

ReadingRatio ratioOf(const CalibrationRequest& request, const Trial& trial, double rate,
                     const std::vector<double>* empty) {
  using Method = CalibrationRequest::Method;
  const std::vector<double>& samples = find(trial, request.topic, request.channel).samples;
  if (request.method == Method::exciter)
    return ratioByExciter(samples, rate, request.frequency, request.exciter);
  if (request.method == Method::mass)
    return ratioByMass(*empty, samples, (request.against ? -1.0 : 1.0) * request.mass * request.gravity);
  const SignalName accelerometer(request.accelerometer);
  return ratioByHits(samples, find(trial, accelerometer.topic, accelerometer.channel).samples, rate,
                     request.mass);
}

void checkQuantity(const CalibrationRequest& request) {
  using Method = CalibrationRequest::Method;
  requireSeconds(request.seconds, LONGEST_RECORD);
  const auto require = [](bool right, const char* what) {
    if (!right) throw Error(what);
  };
  require(request.reference_std >= 0.0, "reference_std: expected 0 or more");
  if (request.method == Method::exciter) {
    require(request.exciter > 0.0, "exciter: expected its effective value, above 0");
    require(request.frequency > 0.0, "frequency: expected the frequency of the exciter in Hz, above 0");
  } else if (request.method != Method::empty) {
    require(request.mass > 0.0, "mass: expected the mass in kg, above 0");
    require(request.gravity > 0.0, "gravity: expected m/s2, above 0");
  }
  if (request.method == Method::hits)
    require(request.accelerometer.find('/') != std::string::npos, "accelerometer: expected TOPIC/CHANNEL");
}

}  // namespace

InstrumentSetup::InstrumentSetup(std::string folder, std::function<double()> now)
    : folder_(std::move(folder)), now_(std::move(now)) {
  if (!fs::is_directory(folder_)) throw Error("folder: " + folder_ + ": expected an existing folder");
}

std::vector<std::string> InstrumentSetup::files() const {
  std::vector<std::string> names;
  for (const auto& entry : fs::directory_iterator(folder_))
    if (entry.path().extension() == ENDING) names.push_back(entry.path().stem().string());
  std::sort(names.begin(), names.end());
  return names;
}

std::string InstrumentSetup::pathOf(const std::string& name) const {
  const bool plain = !name.empty() && name.size() <= LONGEST_NAME &&
                     std::all_of(name.begin(), name.end(), [](unsigned char c) {
                       return std::isalnum(c) != 0 || c == '-' || c == '_';
                     });
  if (!plain)
    throw Error("file: '" + name.substr(0, LONGEST_NAME) + "', expected up to 60 letters, digits, - and _");
  return folder_ + "/" + name + ENDING;
}

Trial InstrumentSetup::tryText(const std::string& description, double seconds) const {
  const TriedFile file(folder_, description);
  try {
    std::optional<StrictYaml> options;
    const Instrument instrument = readInstrument(file.path(), &options);
    std::unique_ptr<Driver> driver = makeDriver(file.path(), instrument, options);
    if (seconds == 0.0) return {};
    return tryInstrument(instrument, std::move(driver), seconds, now_);
  } catch (const Error& error) {
    throw Error(file.named(error.what()));
  }
}

Trial InstrumentSetup::check(const std::string& description, double seconds) const {
  if (seconds != 0.0) requireSeconds(seconds, LONGEST_TRIAL);
  return tryText(description, seconds);
}

std::string InstrumentSetup::store(const std::string& description, const std::string& name,
                                   bool replace) const {
  std::string path = pathOf(name);
  tryText(description, 0.0);
  if (!replace && fs::exists(path)) throw NotWritten(path + ": exists; another name, or replace it");
  try {
    writeText(path, description);
  } catch (const Error& error) {
    throw NotWritten(error.what());
  }
  return path;
}

std::optional<NewSensitivity> InstrumentSetup::calibrate(const CalibrationRequest& request) {
  using Method = CalibrationRequest::Method;
  const std::string path = pathOf(request.file);
  const Key key{request.file, request.topic, request.channel};
  results_.erase(key);
  checkQuantity(request);
  const auto empty = empty_.find(key);
  if (request.method == Method::mass && empty == empty_.end())
    throw Error("method: the sensor was not recorded without the mass yet");
  std::optional<StrictYaml> options;
  const Instrument instrument = readInstrument(path, &options);
  const Channel channel = readChannel(path, request.topic, request.channel);
  const Trial trial = tryInstrument(instrument, makeDriver(path, instrument, options), request.seconds, now_);
  if (!trial.problem.empty()) throw NoSamples(request.file + ": " + trial.problem);
  if (request.method == Method::empty) {
    empty_[key] = find(trial, request.topic, request.channel).samples;
    return {};
  }
  if (request.method == Method::hits) {
    const SignalName accelerometer(request.accelerometer);
    find(trial, accelerometer.topic, accelerometer.channel);
  }
  try {
    const ReadingRatio ratio =
        ratioOf(request, trial, instrument.sample_rate, empty == empty_.end() ? nullptr : &empty->second);
    return results_[key] = sensitivityOf(channel, ratio, request.reference_std);
  } catch (const Error& error) {
    throw UnsuitableRecord(request.channel + ": " + error.what());
  }
}

NewSensitivity InstrumentSetup::storeResult(const std::string& file, const std::string& topic,
                                            const std::string& channel, const std::string& date) {
  const auto result = results_.find({file, topic, channel});
  if (result == results_.end()) throw Error(channel + ": no result to store yet");
  storeSensitivity(pathOf(file), topic, channel, result->second.value, result->second.std_dev, date);
  const NewSensitivity stored = result->second;
  results_.erase(result);
  // Records of the old sensitivity would be in another scale.
  empty_.erase({file, topic, channel});
  return stored;
}

}  // namespace smartmill::daq
