// The driver against a fake of libiio's C interface: a converter of 12 bit with two inputs.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <iio.h>

#include <cerrno>
#include <cstring>
#include <string>
#include <vector>

#include "smartmill_core/testing/temporary_folder.h"
#include "smartmill_daq_testing/listening.h"

// The opaque types of the library
struct iio_channel {
  const char* name;
  bool enabled;
  iio_data_format format;
};
struct iio_device {
  double rate;
};
struct iio_context {
  iio_device device;
};
struct iio_buffer {
  std::size_t samples;
  std::vector<std::uint16_t> codes;
};

namespace {

/// What the fake device does.
struct Device {
  iio_channel channels[2] = {{"voltage0", false, {}}, {"voltage1", false, {}}};
  iio_context context{{10000.0}};
  double highest_rate = 10000.0;
  std::uint16_t next = 0;
  int refills_until_gone = 1000;
  bool there = true;
} device;

}  // namespace

extern "C" {
iio_context* iio_create_context_from_uri(const char* uri) {
  errno = ENODEV;
  return device.there && std::strcmp(uri, "ip:converter") == 0 ? &device.context : nullptr;
}
void iio_context_destroy(iio_context*) {
}
iio_device* iio_context_find_device(const iio_context*, const char* name) {
  return std::strcmp(name, "ad7768") == 0 ? &device.context.device : nullptr;
}
int iio_device_attr_write_double(const iio_device* to, const char*, double value) {
  const_cast<iio_device*>(to)->rate = std::min(value, device.highest_rate);
  return 0;
}
int iio_device_attr_read_double(const iio_device* from, const char*, double* value) {
  *value = from->rate;
  return 0;
}
iio_channel* iio_device_find_channel(const iio_device*, const char* name, bool) {
  for (iio_channel& channel : device.channels) {
    channel.format = {16, 12, 4, true, false, true, false, 0.0, 1};
    if (std::strcmp(channel.name, name) == 0) return &channel;
  }
  return nullptr;
}
bool iio_channel_is_scan_element(const iio_channel*) {
  return true;
}
int iio_channel_attr_read_double(const iio_channel*, const char* attribute, double* value) {
  if (std::strcmp(attribute, "scale") == 0) *value = 2.5;  // [mV]
  if (std::strcmp(attribute, "offset") == 0) *value = 8.0;
  return 0;
}
void iio_channel_enable(iio_channel* channel) {
  channel->enabled = true;
}
iio_buffer* iio_device_create_buffer(const iio_device*, size_t samples, bool) {
  return new iio_buffer{samples, {}};
}
void iio_buffer_destroy(iio_buffer* buffer) {
  delete buffer;
}
int iio_buffer_get_poll_fd(iio_buffer*) {
  return -EBADF;  // as over the network
}
ssize_t iio_buffer_refill(iio_buffer* buffer) {
  if (device.refills_until_gone-- == 0) return -EPIPE;
  buffer->codes.clear();
  for (std::size_t i = 0; i < buffer->samples; ++i) {
    // Twelve bits, left-justified, big-endian: i and -i.
    const std::uint16_t code = device.next++ % 1000;
    for (const int value : {int{code}, -int{code}}) {
      const auto bits = static_cast<std::uint16_t>(static_cast<unsigned>(value) << 4U);
      buffer->codes.push_back(static_cast<std::uint16_t>(bits << 8U | bits >> 8U));
    }
  }
  return static_cast<ssize_t>(buffer->codes.size() * sizeof(std::uint16_t));
}
ptrdiff_t iio_buffer_step(const iio_buffer*) {
  return 2 * sizeof(std::uint16_t);
}
void* iio_buffer_first(const iio_buffer* buffer, const iio_channel* channel) {
  return const_cast<std::uint16_t*>(buffer->codes.data()) + (channel == &device.channels[1] ? 1 : 0);
}
void* iio_buffer_end(const iio_buffer* buffer) {
  return const_cast<std::uint16_t*>(buffer->codes.data()) + buffer->codes.size();
}
const iio_data_format* iio_channel_get_data_format(const iio_channel* channel) {
  return &channel->format;
}
void iio_channel_convert(const iio_channel*, void* to, const void* from) {
  std::uint16_t bits = 0;
  std::memcpy(&bits, from, sizeof bits);
  const auto value = static_cast<std::int16_t>(static_cast<std::int16_t>(bits << 8U | bits >> 8U) >> 4);
  std::memcpy(to, &value, sizeof value);
}
}

namespace smartmill::daq {
namespace {

using ::testing::HasSubstr;
using testing::Listening;

std::string description(const std::string& input, const std::string& rate) {
  return "format: smartmill-instrument/1\nname: converter\ndriver: iio\nsample_rate: " + rate +
         "\nrate_tolerance: 0.4\noptions: {uri: 'ip:converter', device: ad7768}\nstreams:\n  - topic: "
         "daq/vibration\n"
         "    channels:\n      - {input: " +
         input +
         ", name: y, unit: V, sensitivity: 1.0, range: 10.0}\n"
         "      - {input: voltage0, name: x, unit: V, sensitivity: 1.0, range: 10.0}\n";
}

TEST(IioDriver, codesBecomeVoltsAndALostContextIsAnnounced) {
  device = Device();
  device.refills_until_gone = 3;
  TemporaryFolder folder;
  Listening listening(folder.file("iio.yaml"), description("voltage1", "10000.0"));
  ASSERT_TRUE(listening.until([&] { return !listening.faults.empty(); }));
  EXPECT_EQ(listening.faults[0].kind, FaultKind::unplugged);
  EXPECT_THAT(listening.faults[0].text, HasSubstr("Broken pipe"));
  EXPECT_TRUE(device.channels[0].enabled && device.channels[1].enabled);
  int i = 0;
  for (const SampleBlock& block : listening.blocks) {
    for (std::size_t s = 0; s < block.size(); ++s, ++i) {
      ASSERT_NEAR(block.at(s, 0), 2.5e-3 * (8 - i), 1e-12);
      ASSERT_NEAR(block.at(s, 1), 2.5e-3 * (8 + i), 1e-12);
    }
  }
  EXPECT_EQ(i, 150);  // three fragments of 5 ms
}

TEST(IioDriver, whatIsNotThereIsSaid) {
  device = Device();
  TemporaryFolder folder;
  Listening input(folder.file("input.yaml"), description("voltage7", "10000.0"));
  EXPECT_THAT(errorOf([&] { input.until([] { return false; }); }), HasSubstr("has no input voltage7"));
  device.there = false;
  Listening absent(folder.file("absent.yaml"), description("voltage1", "10000.0"));
  ASSERT_TRUE(absent.until([&] { return !absent.faults.empty(); }));
  EXPECT_THAT(absent.faults[0].text, HasSubstr("ip:converter: No such device"));
}

TEST(IioDriver, aRateThatTheDeviceDoesNotTakeIsAnnounced) {
  device = Device();
  TemporaryFolder folder;
  Listening listening(folder.file("rate.yaml"), description("voltage1", "30000.0"));
  ASSERT_TRUE(listening.until([&] { return !listening.faults.empty(); }));
  EXPECT_THAT(listening.faults[0].text, HasSubstr("10000 samples per second, expected 30000"));
  EXPECT_TRUE(listening.blocks.empty());
}

}  // namespace
}  // namespace smartmill::daq
