/// Writes files atomically.
#pragma once

#include <cstddef>
#include <string>

namespace variator_sim {

/// Writes `text` beside the file and renames it once all of it is on the disk: before, an old file
/// stays as it is. Links are followed; a device, a FIFO or a socket is written to and never
/// replaced. Returns "" or why it cannot be written.
std::string writeWholeFile(const std::string& path, const std::string& text);

/// Writes all bytes to `file`. Returns false on failure, with the reason in errno.
bool writeBytes(int file, const char* data, std::size_t size);

}  // namespace variator_sim
