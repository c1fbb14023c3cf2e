#include "io/text_file.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <filesystem>
#include <system_error>

namespace variator_sim {
namespace {

std::string describeError() {
  return std::generic_category().message(errno);
}

/// Returns the file at the end of all links, which need not exist.
std::string followLinks(std::filesystem::path path) {
  constexpr int kMostLinks = 40;  // as Linux follows
  std::error_code error;
  for (int n = 0; n < kMostLinks && std::filesystem::is_symlink(path, error); ++n) {
    path = path.parent_path() / std::filesystem::read_symlink(path, error);
  }
  return path.string();
}

/// Writes the text and closes `file`.
std::string writeAll(int file, const std::string& text, bool syncs) {
  std::string reason;
  if (!writeBytes(file, text.data(), text.size())) reason = describeError();
  if (reason.empty() && syncs && ::fsync(file) != 0) reason = describeError();
  // Some file systems report a full disk only on close.
  if (::close(file) != 0 && reason.empty()) reason = describeError();
  return reason;
}

}  // namespace

bool writeBytes(int file, const char* data, std::size_t size) {
  while (size > 0) {
    const ssize_t written = ::write(file, data, size);
    if (written < 0 && errno != EINTR) return false;
    data += std::max<ssize_t>(written, 0);
    size -= static_cast<std::size_t>(std::max<ssize_t>(written, 0));
  }
  return true;
}

std::string writeWholeFile(const std::string& path, const std::string& text) {
  struct stat old = {};
  const bool exists = ::stat(path.c_str(), &old) == 0;
  if (exists && !S_ISREG(old.st_mode)) {
    const int device = ::open(path.c_str(), O_WRONLY | O_CLOEXEC);
    return device < 0 ? describeError() : writeAll(device, text, false);
  }
  const std::string target = followLinks(path);
  std::string part;
  int file = -1;
  for (int n = 0; file < 0; ++n) {
    part = target + "." + std::to_string(::getpid()) + "." + std::to_string(n) + ".part";
    file = ::open(part.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0666);
    if (file < 0 && errno != EEXIST) return describeError();
  }
  std::string reason;
  if (exists && ::fchmod(file, old.st_mode & 07777U) != 0) reason = describeError();
  const std::string fault = writeAll(file, text, true);
  if (reason.empty()) reason = fault;
  if (reason.empty() && ::rename(part.c_str(), target.c_str()) != 0) reason = describeError();
  if (!reason.empty()) ::unlink(part.c_str());
  return reason;
}

}  // namespace variator_sim
