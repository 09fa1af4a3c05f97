#include "pipeline/pack/image_decoder.h"

#include <fcntl.h>
#include <spawn.h>
#include <sys/socket.h>
#include <sys/time.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <climits>
#include <csignal>
#include <cstring>
#include <string>

#include "pipeline/pack/child_process.h"
#include "pipeline/pack/pack_image.h"

namespace spillway::pipeline {
namespace {

struct Request {
  uint64_t memory_limit_bytes;
  uint32_t time_limit_seconds;
  uint32_t image_index;
  cache::TexelEncoding encoding;
  char source[PATH_MAX];
  char textures_directory[PATH_MAX];
};

// A message means failure.
struct Answer {
  uint32_t failed = 1;
  char message[1000] = {};
  cache::ImageInfo info{};
};

template <class T>
bool send_all(int socket, const T& message) {
  size_t sent = 0;
  while (sent < sizeof message) {
    const ssize_t now =
        send(socket, reinterpret_cast<const char*>(&message) + sent, sizeof message - sent, MSG_NOSIGNAL);
    if (now < 0 && errno == EINTR) continue;
    if (now <= 0) return false;
    sent += static_cast<size_t>(now);
  }
  return true;
}

// False: the other end is closed, or silent for longer than the socket waits; errno is 0 or EAGAIN then.
template <class T>
bool receive_all(int socket, T& message) {
  size_t got = 0;
  while (got < sizeof message) {
    errno = 0;
    const ssize_t now = recv(socket, reinterpret_cast<char*>(&message) + got, sizeof message - got, 0);
    if (now < 0 && errno == EINTR) continue;
    if (now <= 0) return false;
    got += static_cast<size_t>(now);
  }
  return true;
}

Answer answer(const Request& request) {
  limit_this_process(request.memory_limit_bytes, request.time_limit_seconds);
  Answer answer;
  std::string message;
  try {
    const auto info = pack_image(request.source, request.encoding, request.textures_directory, request.image_index,
                                 request.memory_limit_bytes);
    if (info) answer.failed = 0, answer.info = *info;
    if (!info) message = info.error().message;
  } catch (const std::exception& problem) {
    message = fmt::format("{}: its decoder failed: {}", request.source, problem.what());
  }
  message.copy(answer.message, sizeof answer.message - 1);
  return answer;
}

}  // namespace

Status ImageDecoder::start() {
  SPILLWAY_ASSIGN(const std::filesystem::path program, program_beside("spillway_decode_image"));
  int ends[2];
  if (socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, ends) != 0)
    return error("no socket for {}: {}", program.string(), std::strerror(errno));
  const timeval wait{static_cast<time_t>(options_.time_limit_seconds) * 4, 0};
  setsockopt(ends[0], SOL_SOCKET, SO_RCVTIMEO, &wait, sizeof wait);
  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  posix_spawn_file_actions_adddup2(&actions, ends[1], STDIN_FILENO);
  std::string name = program.string();
  char* arguments[] = {name.data(), nullptr};
  const int failed = posix_spawn(&process_, name.c_str(), &actions, nullptr, arguments, environ);
  posix_spawn_file_actions_destroy(&actions);
  close(ends[1]);
  if (failed == 0) {
    socket_ = ends[0];
    return {};
  }
  close(ends[0]);
  return error("{}: cannot be started: {}", name, std::strerror(failed));
}

int ImageDecoder::stop(bool force) {
  int status = 0;
  if (socket_ < 0) return status;
  if (force) kill(process_, SIGKILL);
  close(socket_);
  while (waitpid(process_, &status, 0) < 0 && errno == EINTR) {
  }
  socket_ = -1;
  return status;
}

ImageDecoder::~ImageDecoder() { stop(false); }

Result<cache::ImageInfo> ImageDecoder::pack(const std::filesystem::path& source, cache::TexelEncoding encoding,
                                            const std::filesystem::path& textures_directory, uint32_t image_index) {
  std::error_code code;
  std::filesystem::create_directories(textures_directory, code);
  if (!std::filesystem::is_regular_file(source, code)) return error("{}: there is no such image file", source.string());
  Request request{options_.memory_limit_bytes, options_.time_limit_seconds, image_index, encoding, {}, {}};
  const std::string from = source.string(), to = textures_directory.string();
  if (from.size() >= sizeof request.source || to.size() >= sizeof request.textures_directory)
    return error("{}: the path of the image or of its store, {}, is too long", from, to);
  from.copy(request.source, from.size());
  to.copy(request.textures_directory, to.size());

  if (socket_ < 0) SPILLWAY_TRY(start());
  Answer answer;
  const bool heard = send_all(socket_, request) && receive_all(socket_, answer);
  if (heard && answer.failed == 0) return answer.info;
  const bool silent = !heard && errno == EAGAIN;
  const int status = heard ? 0 : stop(silent);
  std::filesystem::remove(textures_directory / unfinished_image_name(image_index), code);
  if (heard) return error("{}", answer.message);
  if (silent)
    return error("{}: its decoder gave no answer for {} seconds", from, uint64_t{options_.time_limit_seconds} * 4);
  if (!WIFSIGNALED(status)) return error("{}: its decoder ended with code {} and no answer", from, WEXITSTATUS(status));
  return error(
      "{}: its decoder was ended by signal {} ({}); the file is damaged, or needs more memory or time than allowed",
      from, WTERMSIG(status), strsignal(WTERMSIG(status)));
}

void serve_image_decoder(int socket) {
  forbid_core_dumps();
  Request request;
  while (receive_all(socket, request))
    if (!send_all(socket, answer(request))) return;
}

}  // namespace spillway::pipeline
