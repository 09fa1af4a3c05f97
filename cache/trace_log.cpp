#include "cache/trace_log.h"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <memory>
#include <mutex>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "cache/base/memory.h"
#include "cache/file.h"

namespace spillway::cache {
namespace {

constexpr uint64_t kCounter = UINT64_MAX;  // in duration_ns: a counter, whose value is in size_bytes

struct Event {
  const char* category;
  const char* name;
  uint64_t begin_ns, duration_ns;
  uint64_t offset_bytes, size_bytes;
  uint32_t thread;
  uint32_t reserved;
};

struct Log {
  explicit Log(size_t capacity) : events(MemoryTag::trace_log, capacity) {}
  Buffer<Event> events;
  std::atomic<size_t> count{0};  // may pass the capacity
  std::chrono::steady_clock::time_point start = std::chrono::steady_clock::now();
};

std::unique_ptr<Log> owner;
std::atomic<Log*> active{nullptr};

std::mutex names_mutex;
std::vector<std::pair<uint32_t, const char*>> thread_names;
std::atomic<uint32_t> thread_count{0};

uint32_t this_thread() {
  thread_local const uint32_t id = thread_count++;
  return id;
}

uint64_t now_ns(const Log& log) {
  return static_cast<uint64_t>(
      std::chrono::duration_cast<std::chrono::nanoseconds>(std::chrono::steady_clock::now() - log.start).count());
}

void append(Log& log, const Event& event) {
  const size_t at = log.count.fetch_add(1, std::memory_order_relaxed);
  if (at < log.events.size()) log.events[at] = event;
}

double microseconds(uint64_t ns) { return static_cast<double>(ns) * 1e-3; }

void write_event(std::string& out, const Event& e) {
  const auto pid = getpid();
  if (e.duration_ns == kCounter) {
    out += fmt::format("{{\"ph\":\"C\",\"name\":\"{}\",\"pid\":{},\"ts\":{:.3f},\"args\":{{\"value\":{}}}}},\n", e.name, pid,
                       microseconds(e.begin_ns), e.size_bytes);
    return;
  }
  out += fmt::format("{{\"ph\":\"X\",\"cat\":\"{}\",\"name\":\"{}\",\"pid\":{},\"tid\":{},\"ts\":{:.3f},\"dur\":{:.3f}",
                     e.category, e.name, pid, e.thread, microseconds(e.begin_ns), microseconds(e.duration_ns));
  if (e.size_bytes != 0) out += fmt::format(",\"args\":{{\"offset_bytes\":{},\"size_bytes\":{}}}", e.offset_bytes, e.size_bytes);
  out += "},\n";
}

void write_thread_names(std::string& out) {
  const std::lock_guard lock(names_mutex);
  for (const auto& [thread, name] : thread_names)
    out += fmt::format("{{\"ph\":\"M\",\"name\":\"thread_name\",\"pid\":{},\"tid\":{},\"args\":{{\"name\":\"{} {}\"}}}},\n",
                       getpid(), thread, name, thread);
}

}  // namespace

void trace_log_start(size_t event_capacity) {
  owner = std::make_unique<Log>(event_capacity);
  active = owner.get();
}

Status trace_log_write(const std::filesystem::path& path) {
  active = nullptr;
  const std::unique_ptr<Log> log = std::move(owner);
  if (!log) return error("{}: there is no trace to write", path.string());
  SPILLWAY_ASSIGN(WriteFile file, WriteFile::create(path, IoPurpose::scene));
  const size_t asked = log->count.load(), kept = std::min(asked, log->events.size());
  std::string text = "{\"displayTimeUnit\":\"ms\",\"traceEvents\":[\n";
  const auto flush = [&](size_t limit) -> Status {
    if (text.size() < limit) return {};
    SPILLWAY_TRY(file.append(std::as_bytes(std::span(text))));
    text.clear();
    return {};
  };
  write_thread_names(text);
  for (size_t i = 0; i < kept; ++i) {
    write_event(text, log->events[i]);
    SPILLWAY_TRY(flush(1 << 20));
  }
  // The last one has no comma behind it.
  text += fmt::format("{{\"ph\":\"M\",\"name\":\"process_name\",\"pid\":{},\"args\":{{\"name\":\"spillway\"}}}}\n],"
                      "\"otherData\":{{\"dropped_events\":{}}}}}\n",
                      getpid(), asked - kept);
  SPILLWAY_TRY(flush(0));
  return file.commit();
}

void trace_log_name_thread(const char* name) {
  if (!active.load(std::memory_order_relaxed)) return;
  const std::lock_guard lock(names_mutex);
  thread_names.emplace_back(this_thread(), name);
}

void trace_log_counter(const char* name, uint64_t value) {
  Log* const log = active.load(std::memory_order_relaxed);
  if (log) append(*log, {"", name, now_ns(*log), kCounter, 0, value, 0, 0});
}

TraceSpan::TraceSpan(const char* category, const char* name) : category_(category), name_(name) {
  if (const Log* const log = active.load(std::memory_order_relaxed)) begin_ns_ = now_ns(*log);
}

TraceSpan::~TraceSpan() {
  Log* const log = active.load(std::memory_order_relaxed);
  if (!log) return;
  append(*log, {category_, name_, begin_ns_, now_ns(*log) - begin_ns_, offset_bytes_, size_bytes_, this_thread(), 0});
}

}  // namespace spillway::cache
