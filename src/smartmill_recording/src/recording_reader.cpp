#include "smartmill_recording/recording_reader.h"

#include <algorithm>
#include <utility>

#include "message_definition.h"
#include "smartmill_core/error.h"

namespace smartmill {
namespace {

constexpr std::size_t REPORT_EVERY = 1000;  // messages

}  // namespace

RecordingReader::RecordingReader(const std::string& path) : RecordingReader(bytesOfFile(path), path) {
}

RecordingReader::RecordingReader(RecordingBytes bytes, const std::string& name)
    : path_(name), file_(openRecording(std::move(bytes), name)) {
}

bool RecordingReader::has(const std::string& topic) const {
  const std::string name = names::absolute(topic);
  const auto& connections = file_->connections();
  return std::any_of(connections.begin(), connections.end(),
                     [&name](const auto& connection) { return connection.second.topic == name; });
}

double RecordingReader::duration() const {
  // A difference of two dates in seconds loses digits.
  return first_ ? 1e-9 * static_cast<double>(last_.time - first_->time) : 0.0;
}

void RecordingReader::requireFields(const RecordedConnection& connection, const char* type,
                                    const char* definition) const {
  const std::string expected = fieldsMd5(type, definition);
  if (connection.encoding != "ros1" || connection.type != type || expected.empty() ||
      fieldsMd5(connection.type, connection.definition) != expected)
    refuse(connection, type);
}

void RecordingReader::refuse(const RecordedConnection& connection, const char* expected) const {
  throw Error(path_ + ": topic " + connection.topic + " holds " + connection.type +
              (connection.type == expected ? " of another definition" : "") +
              (connection.encoding == "ros1" ? "" : " encoded as " + connection.encoding) + ", expected " +
              expected + (connection.type == expected ? " as this version defines it" : ""));
}

void RecordingReader::refuse(const RecordedConnection& connection, const std::exception& error) const {
  throw Error(path_ + ": topic " + connection.topic + ": " + error.what());
}

void RecordingReader::run(const std::function<void(double)>& progress) {
  std::size_t done = 0;
  // A topic is looked up once for each connection, not for each message.
  std::map<std::uint32_t, const std::function<void(const Instance&)>*> handler_of;
  while (file_->next(&last_)) {
    if (!first_) first_ = last_;
    const RecordedConnection& connection = file_->connection(last_);
    const auto [known, is_new] = handler_of.try_emplace(last_.connection, nullptr);
    if (is_new) {
      const auto handler = handlers_.find(connection.topic);
      known->second = handler == handlers_.end() ? nullptr : &handler->second;
    }
    if (known->second != nullptr)
      (*known->second)({connection, file_->data(last_), last_.size, last_.seconds()});
    if (progress && ++done % REPORT_EVERY == 0) progress(file_->share());
  }
  if (progress) progress(1.0);
}

}  // namespace smartmill
