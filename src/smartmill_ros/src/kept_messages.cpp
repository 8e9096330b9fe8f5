#include "smartmill_ros/kept_messages.h"

#include <ros/param.h>
#include <ros/this_node.h>

namespace smartmill {
namespace {

constexpr const char* DIGITS = "0123456789abcdef";

int digitOf(char c) {
  if (c >= '0' && c <= '9') return c - '0';
  return c >= 'a' && c <= 'f' ? c - 'a' + 10 : -1;
}

}  // namespace

std::string hexOf(const std::vector<std::uint8_t>& bytes) {
  std::string hex;
  hex.reserve(2 * bytes.size());
  for (const std::uint8_t byte : bytes) {
    hex += DIGITS[byte >> 4];
    hex += DIGITS[byte & 15];
  }
  return hex;
}

std::vector<std::uint8_t> bytesOf(const std::string& hex) {
  std::vector<std::uint8_t> bytes;
  bytes.reserve(hex.size() / 2);
  for (std::size_t i = 0; i + 1 < hex.size(); i += 2) {
    const int high = digitOf(hex[i]), low = digitOf(hex[i + 1]);
    if (high < 0 || low < 0) return {};
    bytes.push_back(static_cast<std::uint8_t>(16 * high + low));
  }
  return hex.size() % 2 == 0 ? bytes : std::vector<std::uint8_t>();
}

std::string launchParameter(const ros::NodeHandle& nh) {
  return nh.resolveName("kept/launch");
}

std::string keptParameter(const ros::NodeHandle& nh) {
  return nh.resolveName("kept") + "/" +
         ros::param::param<std::string>(launchParameter(nh), "launch_without_name") +
         ros::this_node::getName();
}

KeptTexts::KeptTexts(const ros::NodeHandle& nh, const std::string& name)
    : parameter_(keptParameter(nh) + "/" + name) {
}

void KeptTexts::keep(const std::string& key, const std::string& text) {
  ros::param::set(parameter_ + "/" + key, text);
}

std::map<std::string, std::string> KeptTexts::all() const {
  std::map<std::string, std::string> texts;
  ros::param::get(parameter_, texts);
  return texts;
}

void KeptTexts::forget() {
  ros::param::del(parameter_);
}

}  // namespace smartmill
