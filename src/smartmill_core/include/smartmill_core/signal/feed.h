#pragma once

#include <string>

namespace smartmill {

/// Connects a topic to a class that sorts and evaluates. @param source the Inputs of a node or a
/// RecordingReader: what both do alike is written once. @param Data core type that the topic carries
template <class Data, class Source, class Sorted>
void feed(Source& source, const std::string& topic, Sorted& sorted) {
  source.template on<Data>(topic, [&sorted](const Data& data, double) { sorted.push(data); });
}

}  // namespace smartmill
