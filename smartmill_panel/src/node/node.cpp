#include "node/node.h"

#include <cstdio>
#include <sstream>

#include <smartmill_msgs/ChatterState.h>
#include <smartmill_msgs/ForceRevolution.h>
#include <smartmill_msgs/ForceSpectrum.h>
#include <smartmill_msgs/ForceStrip.h>
#include <nlohmann/json.hpp>

#include "node/instrument_queries.h"
#include "node/service_queries.h"
#include "smartmill_core/error.h"
#include "smartmill_core/names.h"
#include "smartmill_ros/node_main.h"
#include "smartmill_ros/parameter_server.h"
#include "smartmill_ros/run_node.h"

namespace smartmill::panel {
namespace {

constexpr double INPUT_TIMEOUT = 2.0;                        // [s]
constexpr double DISCOVER_PERIOD = 0.5, CLOCK_PERIOD = 0.5;  // [s]

constexpr const char* ADDRESS_PARAMETER = "panel_at";  // parameter with the address of a panel

using StripMessage = smartmill_msgs::ForceStrip;

PanelParameters read(const ros::NodeHandle& private_nh) {
  PanelParameters parameters = parametersFromServer(private_nh).readAll<PanelParameters>();
  if (parameters.page.empty()) throw Error("page: empty, expected the folder of the page");
  return parameters;
}

std::vector<std::string> words(const std::string& text) {
  std::istringstream in(text);
  std::vector<std::string> list;
  for (std::string word; in >> word;) list.push_back(word);
  return list;
}

ServerOptions optionsOf(const PanelParameters& parameters) {
  ServerOptions options;
  options.address = parameters.address;
  options.port = parameters.port;
  options.folder = parameters.page;
  options.name = parameters.name;
  options.names = words(parameters.names);
  options.origins = words(parameters.origins);
  options.others = words(parameters.machines);
  options.queue = static_cast<std::size_t>(parameters.queue * 1e6);
  options.most_clients = static_cast<std::size_t>(parameters.most_clients);
  return options;
}

CommandGate gateOf(const PanelParameters& parameters) {
  return parameters.allow_commands ? CommandGate(parameters.token_file) : CommandGate();
}

}  // namespace

PanelNode::PanelNode(ros::NodeHandle nh, ros::NodeHandle private_nh)
    : parameters_(read(private_nh)),
      nh_(nh),
      shell_(nh, private_nh, "none", INPUT_TIMEOUT),
      gate_(gateOf(parameters_)),
      strip_(nh.advertise<StripMessage>(names::FORCE_STRIP, 1000)),
      revolution_(nh.advertise<smartmill_msgs::ForceRevolution>(names::FORCE_REVOLUTION, 100)),
      spectrum_(nh.advertise<smartmill_msgs::ForceSpectrum>(names::FORCE_SPECTRUM, 100)),
      log_(nh),
      server_(optionsOf(parameters_),
              {[this](std::uint32_t channel, bool wanted) {
                 discovery_.post([this, channel, wanted] { bridge_.setWanted(channel, wanted); });
               },
               [this](ApiRequest request, const Server::Respond& respond) {
                 answer(std::move(request), respond);
               }}),
      bridge_(nh, server_) {
  if (gate_.open()) commands_ = std::make_unique<Commands>(nh, log_);
  authorised_ = {
      {"command", [this](const ApiRequest& request) { return commands_->run(request); }},
      {"instrument", [this](const ApiRequest& request) { return tryInstrument(nh_, request, log_); }},
      {"calibrate", [this](const ApiRequest& request) { return calibrateChannel(nh_, request, log_); }}};
  listen();
  shell_.every(DISCOVER_PERIOD, [this] {
    if (!discovery_.busy()) discovery_.post([this] { bridge_.discover(); });
  });
  shell_.every(CLOCK_PERIOD, [this] { server_.sendTime(ros::WallTime::now().toNSec()); });
  shell_.every(parameters_.digest_period, [this] {
    for (Digests& digests : digests_) publish(digests);
  });
  shell_.diagnose("panel", [this](auto& status) { diagnose(status); });
  const std::string host = parameters_.address == "0.0.0.0" ? "localhost" : parameters_.address;
  nh.setParam(ADDRESS_PARAMETER, "http://" + host + ":" + std::to_string(server_.port()) + "/");
  std::printf("panel: look at http://%s:%d/%s\n", host.c_str(), server_.port(),
              gate_.open() ? " (commands are allowed, with the token)" : "");
  std::fflush(stdout);
}

PanelNode::~PanelNode() {
  discovery_.stop();
  worker_.stop();
  instruments_.stop();
}

void PanelNode::listen() {
  shell_.inputs().on<smartmill_msgs::SpindleAngle>(
      names::SPINDLE_ANGLE,
      [this](const smartmill_msgs::SpindleAngle& message, double) { angle_.push(fromMsg(message)); });
  shell_.inputs().on<smartmill_msgs::CuttingCondition>(
      names::CUTTING_CONDITION, [this](const smartmill_msgs::CuttingCondition& message, double) {
        if (message.name != condition_)
          for (Digests& digests : digests_) digests.revolution->reset();
        condition_ = message.name;
        cut_ = message.kind == smartmill_msgs::CuttingCondition::CUT;
        if (!cut_) steady_ = false;
        teeth_ = message.teeth;
      });
  shell_.inputs().on<smartmill_msgs::ChatterState>(
      names::CHATTER_STATE,
      [this](const smartmill_msgs::ChatterState& message, double) { steady_ = cut_ && message.valid; });
  listen(names::FORCE_MEASURED, StripMessage::MEASURED);
  listen(names::FORCE_COMPENSATED, StripMessage::COMPENSATED);
  listen(names::TWIN_FORCE, StripMessage::TWIN);
}

void PanelNode::listen(const char* topic, std::size_t source) {
  Digests& digests = digests_.at(source);
  digests.source = static_cast<std::uint8_t>(source);
  digests.strip = std::make_unique<StripMaker>(parameters_.strip, [this, source](const auto& strip) {
    StripMessage message;
    message.header.stamp = fromSec(strip.stamp);
    message.source = static_cast<std::uint8_t>(source);
    message.bin = strip.bin;
    message.low = strip.low;
    message.high = strip.high;
    strip_.publish(message);
  });
  digests.revolution = std::make_unique<RevolutionMaker>(parameters_.revolution);
  digests.spectrum = std::make_unique<SpectrumMaker>(parameters_.spectrum);
  shell_.inputs().on<smartmill_msgs::ForceBlock>(
      topic, [this, &digests](const smartmill_msgs::ForceBlock& message, double) {
        const ForceBlock block = fromMsg(message);
        digests.strip->push(block);
        digests.revolution->push(block, angle_);
        digests.spectrum->push(block);
      });
}

void PanelNode::publish(Digests& digests) {
  if (const auto found = digests.revolution->take()) {
    smartmill_msgs::ForceRevolution message;
    message.header.stamp = fromSec(found->stamp);
    message.condition = condition_;
    message.steady = steady_;
    message.source = digests.source;
    message.spindle_speed = found->spindle_speed;
    message.revolutions = found->revolutions;
    message.bins = static_cast<std::uint32_t>(found->bins);
    message.mean = found->mean;
    message.low = found->low;
    message.high = found->high;
    revolution_.publish(message);
  }
  if (const auto found = digests.spectrum->take()) {
    smartmill_msgs::ForceSpectrum message;
    message.header.stamp = fromSec(found->stamp);
    message.condition = condition_;
    message.steady = steady_;
    message.source = digests.source;
    message.spindle_speed = angle_.speed();
    message.teeth = teeth_;
    message.resolution = found->resolution;
    message.step = found->step;
    message.fx = found->amplitude[0];
    message.fy = found->amplitude[1];
    message.fz = found->amplitude[2];
    spectrum_.publish(message);
  }
}

// In the server's thread.
void PanelNode::answer(ApiRequest request, const Server::Respond& respond) {
  constexpr int BUSY = 503, BAD_REQUEST = 400;
  // A record for a calibration takes up to a minute.
  const bool slow = request.path == "instrument" || request.path == "calibrate";
  Worker& worker = slow ? instruments_ : worker_;
  const bool taken = worker.post([this, request = std::move(request), respond] {
    try {
      respond(answerNow(request));
    } catch (const Error& error) {
      respond(messageResponse(BAD_REQUEST, error.what()));
    }
  });
  if (!taken) respond(messageResponse(BUSY, "too many requests at once"));
}

ApiResponse PanelNode::answerNow(const ApiRequest& request) {
  constexpr int NOT_FOUND = 404;
  if (request.path == "config") return {200, config()};
  if (request.path == "what_if") return queryWhatIf(nh_, request);
  if (request.path == "coefficients") return queryCoefficients(nh_, request);
  if (request.path == "report") return newestReport(parameters_.reports);
  if (request.path == "note") return takeNote(request, log_);
  if (request.path == "replay") return controlReplay(nh_, request);
  if (request.path == "sound") return setSoundCut(nh_, request, log_);
  for (const auto& [path, run] : authorised_) {
    if (request.path != path) continue;
    if (const auto refusal = gate_.refusal(request)) {
      ROS_WARN("panel: %s from %s refused", path.c_str(), request.from.c_str());
      return *refusal;
    }
    return run(request);
  }
  return messageResponse(NOT_FOUND, "unknown request");
}

std::string PanelNode::config() const {
  // Panels of other machines with the same master; each sets its address at its start.
  nlohmann::json panels = nlohmann::json::object();
  std::vector<std::string> keys;
  ros::param::getParamNames(keys);
  const std::string ending = std::string("/") + ADDRESS_PARAMETER;
  for (const std::string& key : keys) {
    std::string address;
    if (key.size() > ending.size() && key.compare(key.size() - ending.size(), ending.size(), ending) == 0 &&
        ros::param::get(key, address))
      panels[key.substr(0, key.size() - ending.size())] = address;
  }
  return nlohmann::json({{"name", parameters_.name},
                         {"namespace", nh_.getNamespace()},
                         {"commands", gate_.open()},
                         {"machines", words(parameters_.machines)},
                         {"panels", panels}})
      .dump();
}

void PanelNode::diagnose(diagnostic_updater::DiagnosticStatusWrapper& status) {
  const ServerStatistics statistics = server_.statistics();
  status.summary(diagnostic_msgs::DiagnosticStatus::OK, "serving");
  status.add("clients", statistics.clients);
  status.add("messages sent", statistics.sent);
  status.add("megabytes sent", 1e-6 * static_cast<double>(statistics.bytes));
  status.add("messages dropped for slow clients", statistics.dropped);
  status.add("requests refused", statistics.refused);
}

}  // namespace smartmill::panel

int smartmill::nodeMain(int argc, char** argv) {
  return runNode<panel::PanelNode>(argc, argv, "panel");
}
