#include "cache/reads_ahead.h"

#include <utility>

#include "cache/base/check.h"
#include "cache/trace_log.h"

namespace spillway::cache {
namespace {

constexpr int kReaders = 4;  // reads under way

}  // namespace

ReadsAhead::~ReadsAhead() {
  {
    const std::lock_guard lock(mutex_);
    ends_ = true;
  }
  to_readers_.notify_all();
  for (std::thread& reader : readers_) reader.join();
}

void ReadsAhead::begin(std::vector<Read> reads) {
  if (reads.empty()) return;
  {
    const std::lock_guard lock(mutex_);
    SPILLWAY_CHECK(done_, ==, reads_.size());
    reads_ = std::move(reads);
    next_ = done_ = 0;
  }
  for (int i = static_cast<int>(readers_.size()); i < kReaders; ++i)
    readers_.emplace_back([this] { read_until_ended(); });
  to_readers_.notify_all();
}

Status ReadsAhead::finish() {
  std::unique_lock lock(mutex_);
  to_caller_.wait(lock, [this] { return done_ == reads_.size(); });
  reads_.clear();
  next_ = done_ = 0;
  if (const std::optional<Error> failure = std::exchange(failure_, std::nullopt)) return *failure;
  return {};
}

void ReadsAhead::read_until_ended() {
  trace_log_name_thread("reader");
  std::unique_lock lock(mutex_);
  for (;;) {
    to_readers_.wait(lock, [this] { return ends_ || next_ < reads_.size(); });
    if (ends_) return;
    const size_t index = next_++;
    const Read& read = reads_[index];  // stays where it is until all are done
    lock.unlock();
    const Status status = read();
    lock.lock();
    if (!status && (!failure_ || index < failed_)) failure_ = status.error(), failed_ = index;
    if (++done_ == reads_.size()) to_caller_.notify_all();
  }
}

}  // namespace spillway::cache
