#pragma once

#include <string>
#include <vector>

namespace smartmill::exchange {

/// Category of a data item as MTConnect (Part 2, 1.8) defines it: samples change continuously, events at
/// times, conditions are normal, in warning or in fault.
enum class Category { sample, event, condition };

/// One data item, declared once for all protocols (data_items.cpp).
struct DataItem {
  std::string id;         ///< unique; XML identifier in MTConnect, key in SHDR, topic level in MQTT
  std::string component;  ///< id of its Component
  Category category = Category::sample;
  std::string type;      ///< of MTConnect; with the prefix `s:` of this project's extension
  std::string sub_type;  ///< empty: none
  std::string statistic;
  std::string units;        ///< of MTConnect; empty for events and conditions
  bool set = false;         ///< several values by key (representation DATA_SET)
  std::string meaning;      ///< one line
  std::string uncertainty;  ///< what is known of it; the id of the item that carries it, if there is one
  std::string bandwidth;    ///< up to which frequency the value follows the machine
  std::string source = {};  ///< topic, relative to /smartmill
};

/// A part of the machine that data items belong to.
struct Component {
  std::string id, parent;  ///< parent: id; empty: the device
  std::string element;     ///< of MTConnect, e.g. Controller
  std::string name;
};

/// Every component after its parent.
const std::vector<Component>& components();

}  // namespace smartmill::exchange
