#include <filesystem>
#include <iostream>
#include <string>

#include <nlohmann/json.hpp>

#include "smartmill_core/error.h"
#include "smartmill_core/formatted.h"
#include "smartmill_core/io/csv.h"
#include "smartmill_core/io/text_file.h"
#include "smartmill_exchange/commands.h"
#include "smartmill_exchange/items/catalogue.h"
#include "smartmill_exchange/items/json.h"
#include "smartmill_exchange/items/translator.h"
#include "smartmill_recording/reading_progress.h"
#include "smartmill_recording/recording_reader.h"

namespace smartmill::exchange {
namespace {

constexpr double TICK = 0.2;  // [s] as exchange_node

struct Options {
  std::string recording, out = "items";
  TranslatorParameters parameters;
};

struct ReadTopic {
  RecordingReader& reader;
  Translator& translator;
  double& ticked;

  template <class Message>
  void operator()(const char* topic) const {
    reader.on<Message>(topic, [self = *this](const Message& message, double received) {
      if (received - self.ticked >= TICK) self.translator.tick(self.ticked = received);
      self.translator.take(message, received);
    });
  }
};

std::string textOf(const Activations& active) {
  std::vector<std::string> texts;
  for (const Activation& a : active)
    texts.push_back(std::string(a.fault ? "fault " : "warning ") + a.code + ": " + a.text);
  return texts.empty() ? "normal" : joined(texts, "; ");
}

void run(const Options& options) {
  RecordingReader reader(options.recording);
  CsvWriter table("time[s],utc,item,key,value,text,units");
  nlohmann::ordered_json assets = nlohmann::ordered_json::array();
  std::size_t observations = 0;
  const auto row = [&](const Observation& o, const std::string& key, const std::string& value,
                       const std::string& text) {
    const DataItem& item = catalogue()[o.item];
    table.row(formatted("%.6f", o.time), timeText(o.time), item.id, key, value, text, item.units);
    ++observations;
  };
  Translator translator(
      options.parameters,
      {[&](const Observation& o) {
         if (const auto* number = std::get_if<double>(&o.value)) {
           row(o, "", numberText(*number), "");
         } else if (const auto* set = std::get_if<DataSet>(&o.value)) {
           for (const auto& [key, one] : *set) row(o, key, numberText(one), "");
         } else if (const auto* text = std::get_if<Text>(&o.value)) {
           row(o, "", "", text->text);
         } else if (const auto* active = std::get_if<Activations>(&o.value)) {
           row(o, "", "", textOf(*active));
         } else {
           row(o, "", "", "unavailable");
         }
       },
       [&](const Asset& asset) { assets.push_back(nlohmann::ordered_json::parse(assetJson(asset))); }});
  double ticked = 0.0;
  Translator::forEachTopic(ReadTopic{reader, translator, ticked});
  reader.run(printReadingProgress);
  if (observations == 0) throw Error(options.recording + ": no topic of a data item found");
  std::filesystem::create_directories(options.out);
  table.save(options.out + "/items.csv");
  writeText(options.out + "/assets.json", assets.dump(1) + "\n");
  std::cout << options.out << "/items.csv: " << observations << " values; " << options.out
            << "/assets.json: " << assets.size() << " states of assets\n";
}

void addOptions(CommandLine& line, Options& options) {
  line.option("RECORDING", options.recording, "bag or MCAP file").required();
  line.option("-o,--out", options.out, "folder for items.csv and assets.json").showDefault();
  line.option("--sample-period", options.parameters.sample_period,
              "[s] least time between two values of a sample")
      .notNegative()
      .showDefault();
  line.option("--force-interval", options.parameters.force_interval,
              "[s] least time of whole revolutions of a force peak")
      .positive()
      .showDefault();
}

}  // namespace

smartmill::Command itemsCommand() {
  smartmill::Command command("items", "writes the data items of a recording as CSV with units");
  command.description =
      "The data items that exchange_node sends by MTConnect and MQTT (docs/exchange.md), of a recording: "
      "controller state, force peaks "
      "and effective values, chatter, stability margin, friction, as one table with units; coefficients, "
      "modes and charts as JSON.";
  command.examples = {{"session.bag -o items", "items.csv and assets.json of a recorded session"}};
  command.files = {{"OUT/items.csv", "time[s], UTC, item, key, value, text, units"},
                   {"OUT/assets.json", "every state of every asset, in order"}};
  command.setBody(run, addOptions);
  return command;
}

}  // namespace smartmill::exchange
