#include "smartmill_discrepancy/live/segment_campaign.h"

#include <algorithm>
#include <cmath>
#include <complex>
#include <limits>
#include <set>
#include <vector>

#include "smartmill_core/formatted.h"

namespace smartmill::discrepancy {
namespace {

/// Square of the difference between two tests: 1 is a clear one. @param duration [s] of the production
double difference(const CampaignTest& a, const CampaignTest& b, double duration) {
  // [1] of speed, feed and depth; [rad] of the arc
  constexpr double SPEED = 0.1, FEED = 0.3, DEPTH = 0.3, ARC = 0.5;
  const auto ratio = [](double x, double y) { return x > 0.0 && y > 0.0 ? std::log(x / y) : 0.0; };
  double sum = std::pow(ratio(a.spindle_speed, b.spindle_speed) / SPEED, 2);
  if (duration > 0.0)
    sum += std::pow((a.start_time.value_or(0.0) - b.start_time.value_or(0.0)) / duration, 2);
  if (!a.engagement || !b.engagement) return sum;
  const Engagement &x = *a.engagement, &y = *b.engagement;
  return sum + std::pow(ratio(x.feed_per_tooth, y.feed_per_tooth) / FEED, 2) +
         std::pow(ratio(x.axial_depth, y.axial_depth) / DEPTH, 2) + std::pow((x.entry - y.entry) / ARC, 2) +
         std::pow((x.exit - y.exit) / ARC, 2) +
         std::norm(std::polar(1.0, a.feed_direction) - std::polar(1.0, b.feed_direction));
}

/// Keeps the last segment, then in turn the one that differs most from those kept (farthest-first traversal,
/// Gonzalez 1985).
std::set<const RecordSegment*> mostDifferent(const std::vector<const RecordSegment*>& all, std::size_t most) {
  if (all.size() <= most) return {all.begin(), all.end()};
  double first = all.front()->test.start_time.value_or(0.0), last = first;
  for (const RecordSegment* one : all) {
    first = std::min(first, one->test.start_time.value_or(0.0));
    last = std::max(last, one->test.start_time.value_or(0.0));
  }
  std::set<const RecordSegment*> kept;
  std::vector<double> distance(all.size(), std::numeric_limits<double>::infinity());
  std::size_t next = all.size() - 1;
  while (kept.size() < most) {
    kept.insert(all[next]);
    for (std::size_t k = 0; k < all.size(); ++k) {
      const double d = difference(all[k]->test, all[next]->test, last - first);
      distance[k] = kept.count(all[k]) > 0 ? -1.0 : std::min(distance[k], d);
    }
    next = static_cast<std::size_t>(std::max_element(distance.begin(), distance.end()) - distance.begin());
  }
  return kept;
}

}  // namespace

void SegmentCampaign::add(const RecordSegment& segment) {
  const auto earlier = std::find_if(segments_.begin(), segments_.end(), [&](const RecordSegment& other) {
    return other.test.name == segment.test.name;
  });
  if (earlier == segments_.end()) {
    segments_.push_back(segment);
  } else {
    *earlier = segment;
  }
}

std::size_t SegmentCampaign::write(const MachineModel& model, const LiveGapOptions& options,
                                   const std::string& folder,
                                   const std::function<void(const std::string&)>& progress) const {
  std::vector<const RecordSegment*> cuts, air;
  for (const RecordSegment& segment : segments_) {
    if (segment.test.kind != TestKind::cut) {
      air.push_back(&segment);
    } else if (hasOtherTool(segment, model)) {
      progress(segment.test.name + ": omitted, cut with another tool than that of the model");
    } else if (model.force_sensor.noise_rms && liveGap(model, segment, options).near_limit) {
      progress(segment.test.name + ": omitted, near the stability limit of the model");
    } else {
      cuts.push_back(&segment);
    }
  }
  std::set<const RecordSegment*> kept;
  const auto keep = [&](const std::vector<const RecordSegment*>& all, std::size_t most, const char* what) {
    const std::set<const RecordSegment*> chosen = mostDifferent(all, most);
    if (chosen.size() < all.size())
      progress(formatted("%zu of %zu %s: those that differ most", chosen.size(), all.size(), what));
    kept.insert(chosen.begin(), chosen.end());
  };
  keep(cuts, MOST_CUTS, "cuts");
  keep(air, MOST_AIR, "air cuts");
  for (const RecordSegment& segment : segments_)
    if (kept.count(&segment) > 0) recordSegment(model, segment, folder);
  return kept.size();
}

}  // namespace smartmill::discrepancy
