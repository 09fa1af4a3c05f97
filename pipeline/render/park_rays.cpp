#include "pipeline/render/park_rays.h"

#include <algorithm>

#include "cache/base/check.h"

namespace spillway::pipeline {

template <class Record>
Status ParkedColumn<Record>::park(const RayColumns<Record>& wave, std::span<const cache::TraceHit> hits) {
  for (size_t i = 0; i < hits.size(); ++i) {
    if ((hits[i].flags & cache::kHitWaits) == 0) continue;
    SPILLWAY_CHECK(size_, <, limit_);
    rays_[size_] = wave.hot[i];
    SPILLWAY_TRY(wave.cold.read(i, {&records_[size_], 1}));
    ++of_half_[records_[size_++].sample & 1];
  }
  return {};
}

template <class Record>
Status ParkedColumn<Record>::unpark(RayColumns<Record>& wave, size_t wave_limit) {
  const size_t held = wave.hot.size();
  const size_t count = std::min(size_, wave_limit > held ? wave_limit - held : 0), first = size_ - count;
  wave.hot.set_size(held + count);
  std::copy_n(rays_.data() + first, count, wave.hot.data() + held);
  for (size_t i = first; i < size_; ++i) --of_half_[records_[i].sample & 1];
  size_ = first;
  return wave.cold.append({records_.data() + first, count});
}

template class ParkedColumn<PathRecord>;
template class ParkedColumn<ShadowRecord>;

}  // namespace spillway::pipeline
