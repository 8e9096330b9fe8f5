#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <string>
#include <type_traits>
#include <vector>

#include "smartmill_recording/message_time.h"

namespace smartmill {

/// Whether a type is a message of smartmill::plain.
template <class Data, class = void>
struct IsMessage : std::false_type {};
template <class Data>
struct IsMessage<Data, std::void_t<decltype(Data::LEAST_SIZE)>> : std::true_type {};

/// Deserialization of ROS 1 (little-endian; strings and lists behind a length of 32 bits). Every length is
/// compared with the bytes that are left before memory is taken for it.
class MessageReader {
 public:
  MessageReader(const std::uint8_t* data, std::size_t size) : at_(data), left_(size) {}

  template <class Value>
  void operator()(Value& value) {
    if constexpr (isPlain<Value>()) {
      std::memcpy(&value, take(sizeof(Value)), sizeof(Value));
    } else {
      Value::visit(value, *this);
    }
  }
  void operator()(plain::Time& time) {
    (*this)(time.sec);
    (*this)(time.nsec);
  }
  void operator()(plain::Duration& duration) {
    (*this)(duration.sec);
    (*this)(duration.nsec);
  }
  void operator()(std::string& text) {
    const std::size_t size = length(1);
    const auto* const begin = reinterpret_cast<const char*>(take(size));
    text.assign(begin, size);
  }
  template <class Value>
  void operator()(std::vector<Value>& values) {
    if constexpr (isPlain<Value>()) {
      const std::size_t count = length(sizeof(Value));
      const std::uint8_t* const begin = take(count * sizeof(Value));
      values.resize(count);
      if (count > 0) std::memcpy(values.data(), begin, count * sizeof(Value));
    } else {
      values.resize(length(leastSize<Value>()));
      for (Value& value : values) (*this)(value);
    }
  }
  template <class Value, std::size_t SIZE>
  void operator()(std::array<Value, SIZE>& values) {
    for (Value& value : values) (*this)(value);
  }

 private:
  template <class Value>
  static constexpr bool isPlain() {
    return std::is_arithmetic_v<Value>;
  }
  template <class Value>
  static constexpr std::size_t leastSize() {
    if constexpr (std::is_same_v<Value, std::string>) {
      return sizeof(std::uint32_t);
    } else if constexpr (std::is_same_v<Value, plain::Time> || std::is_same_v<Value, plain::Duration>) {
      return 2 * sizeof(std::uint32_t);
    } else {
      return Value::LEAST_SIZE;
    }
  }
  /// Of a list whose elements take least bytes each.
  std::size_t length(std::size_t least) {
    std::uint32_t count = 0;
    (*this)(count);
    if (least > 0 && count > left_ / least) fail(count, least);
    return count;
  }
  const std::uint8_t* take(std::size_t size) {
    if (size > left_) fail(1, size);
    const std::uint8_t* const begin = at_;
    at_ += size;
    left_ -= size;
    return begin;
  }
  /// @throws Error
  [[noreturn]] void fail(std::size_t count, std::size_t size) const;

  const std::uint8_t* at_;
  std::size_t left_;
};

/// The reverse.
class MessageWriter {
 public:
  explicit MessageWriter(std::string& bytes) : bytes_(bytes) {}

  template <class Value>
  void operator()(const Value& value) {
    if constexpr (std::is_arithmetic_v<Value>) {
      bytes_.append(reinterpret_cast<const char*>(&value), sizeof(Value));
    } else {
      Value::visit(value, *this);
    }
  }
  void operator()(const plain::Time& time) {
    (*this)(time.sec);
    (*this)(time.nsec);
  }
  void operator()(const plain::Duration& duration) {
    (*this)(duration.sec);
    (*this)(duration.nsec);
  }
  void operator()(const std::string& text) {
    (*this)(static_cast<std::uint32_t>(text.size()));
    bytes_ += text;
  }
  template <class Value>
  void operator()(const std::vector<Value>& values) {
    (*this)(static_cast<std::uint32_t>(values.size()));
    if constexpr (std::is_arithmetic_v<Value>) {
      bytes_.append(reinterpret_cast<const char*>(values.data()), values.size() * sizeof(Value));
    } else {
      for (const Value& value : values) (*this)(value);
    }
  }
  template <class Value, std::size_t SIZE>
  void operator()(const std::array<Value, SIZE>& values) {
    for (const Value& value : values) (*this)(value);
  }

 private:
  std::string& bytes_;
};

/// @throws Error when a length of the message is beyond its bytes.
template <class Message>
void readMessage(const std::uint8_t* data, std::size_t size, Message& message) {
  MessageReader reader(data, size);
  Message::visit(message, reader);
}

template <class Message>
std::string writeMessage(const Message& message) {
  std::string bytes;
  MessageWriter writer(bytes);
  Message::visit(message, writer);
  return bytes;
}

}  // namespace smartmill
