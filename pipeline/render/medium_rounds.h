#pragma once

// Tracks segments in grids whose bricks are not all in memory.
//
// A segment is walked once. What bricks in memory tell is decided at once; from the first point on that lies in another
// brick, a path ray's points are listed up to the one behind which it hardly gets, or surely does not; a shadow ray's
// weights may be multiplied in any order, and only its points in other bricks are listed. One sweep over the bricks of
// the list then tells all of them. What has not ended goes on with the next round.
// Memory: tag volumes: the list, within run_limit_bytes; what a batch of rays adds to it, and what goes on from one
//         round to the next, is held twice meanwhile.
// Order:  points are looked up brick by brick, in file order; what they decide is decided in ray order. Nothing shows.

#include <vector>

#include "cache/radix_sort.h"
#include "pipeline/render/track_media.h"

namespace spillway::pipeline {

// What a block of rays came to.
struct MediumBlock {
  uint64_t segments = 0, steps = 0, bounded = 0;
  std::vector<uint32_t> bricks;  // that were in memory and used, where not all are
  PointList list;
};

class MediumRounds {
 public:
  MediumRounds(const MediaInputs& inputs, const TrackMediaOptions& options, TrackMediaScratch& scratch,
               TrackMediaReport& report)
      : inputs_(inputs), options_(options), scratch_(scratch), report_(report) {}

  // Goes on with a segment as far as bricks in memory tell. True: `result` is what it comes to; else it is listed.
  static bool advance(const MediaInputs& inputs, WaitingSegment& waiting, MediumBlock& block, SegmentResult& result);
  // Takes a block's counts and what waits of it, in the order of its rays.
  Status add(const MediumBlock& block);
  // Tracks what is left.
  Status finish();

 private:
  Status round();
  Status look_up();
  Status settle();
  void settle_segment(WaitingSegment& waiting, MediumBlock& block) const;
  void count(const MediumBlock& block);
  PointList& list() { return scratch_.list; }

  const MediaInputs& inputs_;
  const TrackMediaOptions& options_;
  TrackMediaScratch& scratch_;
  TrackMediaReport& report_;
};

// A segment whose bricks are all in memory.
SegmentResult track_resident(const MediaInputs& inputs, const MediumSegment& segment, bool is_shadow,
                             MediumBlock& block);

}  // namespace spillway::pipeline
