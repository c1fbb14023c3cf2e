#include <array>
#include <cerrno>
#include <cstdint>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <stdexcept>
#include <string>

#include "emit_c/emit_c.h"
#include "io/text_file.h"

namespace variator_sim {
namespace {

namespace fs = std::filesystem;

struct EmittedFile {
  std::string name;
  std::string text;
  const char* begin_comment;
  const char* end_comment;
};

/// Returns `text` with a last line that identifies files written by simulate.
std::string withSum(const EmittedFile& file, const std::string& text) {
  std::uint64_t hash = 14695981039346656037ULL;  // FNV-1a
  for (const char c : text) hash = (hash ^ static_cast<unsigned char>(c)) * 1099511628211ULL;
  char sum[20];
  std::snprintf(sum, sizeof sum, "%016llx", static_cast<unsigned long long>(hash));
  return text + file.begin_comment + "Written by simulate --emit-c, sum " + sum + file.end_comment +
         "\n";
}

/// Returns true if `path` is free, or holds an unchanged file written by simulate.
bool mayReplace(const fs::path& path, const EmittedFile& file) {
  const fs::file_type type = fs::symlink_status(path).type();
  if (type == fs::file_type::not_found) return true;
  std::string text;
  constexpr std::size_t kLongest = 1U << 28U;
  if (type != fs::file_type::regular || !readTextFile(path.string(), &text, kLongest).empty()) {
    return false;
  }
  const std::size_t last_line = text.size() < 2 ? 0 : text.rfind('\n', text.size() - 2) + 1;
  return text == withSum(file, text.substr(0, last_line));
}

void writeFile(const fs::path& path, const std::string& text) {
  std::FILE* const file = std::fopen(path.c_str(), "w");
  const bool is_written =
      file != nullptr && std::fwrite(text.data(), 1, text.size(), file) == text.size();
  const int error = errno;
  const bool is_closed = file == nullptr || std::fclose(file) == 0;
  if (is_written && is_closed) return;
  throw std::runtime_error(path.string() + ": " + std::strerror(is_written ? errno : error));
}

}  // namespace

void writeEmittedScene(const EmittedScene& scene, const std::string& directory) {
  const std::array<EmittedFile, 5> files{{{scene.name + ".h", scene.header, "/* ", " */"},
                                          {scene.name + ".c", scene.source, "/* ", " */"},
                                          {"main.c", scene.main, "/* ", " */"},
                                          {"README.md", scene.readme, "<!-- ", " -->"},
                                          {"Makefile", scene.makefile, "# ", ""}}};
  const fs::path folder = directory;
  std::error_code error;
  fs::create_directories(folder, error);
  if (error) throw std::runtime_error(directory + ": " + error.message());
  for (const EmittedFile& file : files) {
    if (mayReplace(folder / file.name, file)) continue;
    throw std::runtime_error((folder / file.name).string() +
                             ": is there and is not, or no longer, what simulate --emit-c wrote; "
                             "nothing was written. Allowed: a folder without it (--emit-c FOLDER)");
  }
  for (const EmittedFile& file : files) {
    writeFile(folder / file.name, withSum(file, file.text));
  }
}

}  // namespace variator_sim
