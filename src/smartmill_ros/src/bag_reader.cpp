#include "smartmill_ros/bag_reader.h"

#include <rosbag/exceptions.h>
#include <rosbag/view.h>

#include <array>
#include <cstdint>
#include <fstream>

namespace smartmill {
namespace {

constexpr const char* VERSION_LINE = "#ROSBAG V2.0\n";

/// rosbag takes memory for whatever length a damaged record tells; so the lengths are looked at before: each
/// record is u32 and its header, u32 and its data. @throws Error
void checkRecords(const std::string& path) {
  std::ifstream in(path, std::ios::binary | std::ios::ate);
  const std::uint64_t size = in ? static_cast<std::uint64_t>(in.tellg()) : 0;
  std::string version(13, '\0');
  in.seekg(0);
  if (!in.read(version.data(), 13) || version != VERSION_LINE) {
    return;  // rosbag says what it is
  }
  std::uint64_t at = version.size();
  while (at < size) {
    for (int part = 0; part < 2; ++part) {
      std::array<unsigned char, 4> bytes{};
      in.seekg(static_cast<std::streamoff>(at));
      in.read(reinterpret_cast<char*>(bytes.data()), bytes.size());
      const std::uint64_t length =
          bytes[0] | bytes[1] << 8U | bytes[2] << 16U | std::uint64_t{bytes[3]} << 24U;
      at += bytes.size() + length;
      if (!in || (at > size && length <= size)) {
        return;  // cut off: rosbag knows what that means
      }
      if (at > size) {
        throw Error(path + ": is no bag, or damaged: a record tells of " + std::to_string(length) + " bytes");
      }
    }
  }
}

}  // namespace

BagReader::BagReader(const std::string& path) : path_(path) {
  checkRecords(path);
  try {
    bag_.open(path, rosbag::bagmode::Read);
  } catch (const rosbag::BagUnindexedException&) {
    throw Error(path + ": the bag has no index: its recording was cut off (rosbag reindex mends it)");
  } catch (const rosbag::BagIOException&) {
    throw Error(path + ": cannot be read as a bag: missing, or cut off");
  } catch (const std::exception& e) {
    throw Error(path + ": is no bag: " + e.what());
  }
}

bool BagReader::has(const std::string& topic) const {
  rosbag::View view(bag_, rosbag::TopicQuery(names::absolute(topic)));
  return view.size() > 0;
}

double BagReader::duration() const {
  rosbag::View view(bag_);
  return view.size() == 0 ? 0.0 : (view.getEndTime() - view.getBeginTime()).toSec();
}

void BagReader::run(const std::function<void(double)>& progress) {
  std::vector<std::string> topics;
  for (const auto& handler : handlers_) topics.push_back(handler.first);
  try {
    rosbag::View view(bag_, rosbag::TopicQuery(topics));
    std::size_t done = 0;
    for (const rosbag::MessageInstance& instance : view) {
      handlers_.at(instance.getTopic())(instance);
      if (progress && ++done % 1000 == 0) progress(static_cast<double>(done) / view.size());
    }
    if (progress) progress(1.0);
  } catch (const Error&) {
    throw;
  } catch (const std::exception& e) {
    // Of the bag, or of a message whose lengths are not its own.
    throw Error(path_ + ": the bag ends too early or is damaged: " + e.what());
  }
}

}  // namespace smartmill
