#pragma once

#include <string>

#include "smartmill_ros/conversions.h"

namespace smartmill {

/// A topic, turned into its core type, into a class that sorts and thinks. @param source the Inputs of a node
/// or a BagReader: what both do the same is written once, for either.
template <class Message, class Source, class Sorted>
void feed(Source& source, const std::string& topic, Sorted& sorted) {
  source.template on<Message>(topic,
                              [&sorted](const Message& message, double) { sorted.push(fromMsg(message)); });
}

}  // namespace smartmill
