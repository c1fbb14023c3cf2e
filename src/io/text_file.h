/// Reads and writes whole files.
#pragma once

#include <cerrno>
#include <cstdint>
#include <fstream>
#include <limits>
#include <string>
#include <system_error>

#include "model/number_text.h"

namespace variator_sim {

/// Reads a whole file of at most about `most` bytes into `text`. Returns "" or why it cannot be
/// read.
inline std::string readTextFile(const std::string& path, std::string* text,
                                std::size_t most = std::numeric_limits<std::size_t>::max()) {
  errno = 0;
  std::ifstream file(path, std::ios::binary);
  char buffer[4096];
  // A folder can be opened; only reading it fails.
  while (file && (file.read(buffer, sizeof(buffer)), file.gcount() > 0)) {
    text->append(buffer, static_cast<std::size_t>(file.gcount()));
    if (text->size() > most) return "it is longer than " + std::to_string(most) + " bytes";
  }
  if (file.eof() && !file.bad()) return "";
  return errno != 0 ? std::generic_category().message(errno) : "unknown cause";
}

/// Writes `text` beside the file and renames it once all of it is on the disk: before, an old file
/// stays as it is. Links are followed; a device, a FIFO or a socket is written to and never
/// replaced. Returns "" or why it cannot be written.
std::string writeWholeFile(const std::string& path, const std::string& text);

/// Writes all bytes to `file`. Returns false on failure, with the reason in errno.
bool writeBytes(int file, const char* data, std::size_t size);

/// Returns a checksum of a text in 16 hexadecimal digits (FNV-1a).
inline std::string checksumOf(const std::string& text,
                              std::uint64_t hash = 14695981039346656037ULL) {
  for (const char c : text) hash = (hash ^ static_cast<unsigned char>(c)) * 1099511628211ULL;
  return printed("%016llx", static_cast<unsigned long long>(hash));
}

}  // namespace variator_sim
