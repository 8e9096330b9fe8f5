#pragma once

#include <string>

namespace smartmill {

/// Connects a topic to a pipeline. @param source the Inputs of a node or a RecordingReader. @tparam Data core
/// type of the topic
template <class Data, class Source, class Sorted>
void feed(Source& source, const std::string& topic, Sorted& sorted) {
  source.template on<Data>(topic, [&sorted](const Data& data, double) { sorted.push(data); });
}

}  // namespace smartmill
