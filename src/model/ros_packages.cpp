#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <map>
#include <system_error>
#include <utility>
#include <vector>

#include "io/text_file.h"
#include "model/table_file.h"

namespace variator_sim {
namespace {

namespace fs = std::filesystem;

/// Returns the parts that are not empty.
std::vector<std::string> split(const std::string& text, char separator) {
  std::vector<std::string> parts = splitAt(text, separator);
  parts.erase(std::remove(parts.begin(), parts.end(), ""), parts.end());
  return parts;
}

std::string variable(const char* name) {
  const char* const value = std::getenv(name);
  return value != nullptr ? value : "";
}

/// Returns the folders that have packages in them, in the order of search, and how deep.
std::vector<std::pair<fs::path, int>> listRoots() {
  constexpr int kDepth = 8;
  constexpr int kInstalled = 1;  // PREFIX/share/PACKAGE
  std::vector<std::pair<fs::path, int>> roots;
  for (const std::string& root :
       split(variable("ROS_PACKAGE_PATH") + ":" + variable("ROS_ROOT"), ':')) {
    roots.emplace_back(root, fs::path(root).filename() == "share" ? kInstalled : kDepth);
  }
  for (const std::string& prefix : split(variable("CMAKE_PREFIX_PATH"), ':')) {
    std::string sources;  // of a build space, written by catkin
    if (readTextFile((fs::path(prefix) / ".catkin").string(), &sources).empty()) {
      for (const std::string& source : split(sources, ';')) roots.emplace_back(source, kDepth);
    }
    roots.emplace_back(fs::path(prefix) / "share", kInstalled);
  }
  roots.emplace_back("/usr/share", kInstalled);
  return roots;
}

/// Returns the name in the package.xml of a folder, or the folder's where it names none; "" without
/// a package.xml.
std::string nameOfPackage(const fs::path& folder) {
  constexpr std::size_t kLongest = 1U << 20U;
  std::string text;
  if (!readTextFile((folder / "package.xml").string(), &text, kLongest).empty()) return "";
  const std::size_t tag = text.find("<name>");
  if (tag == text.npos) return folder.filename().string();
  const std::size_t begin = std::min(text.find_first_not_of(" \t\r\n", tag + 6), text.size());
  return text.substr(begin, text.find_first_of("< \t\r\n", begin) - begin);
}

/// Adds the packages in a folder and below; the first of a name counts. Below a package there is
/// none.
void crawl(const fs::path& folder, int depth, std::map<std::string, fs::path>* packages) {
  std::error_code error;
  if (fs::exists(folder / "CATKIN_IGNORE", error)) return;
  const std::string name = nameOfPackage(folder);
  if (!name.empty()) packages->emplace(name, folder);
  if (!name.empty() || depth == 0 || fs::exists(folder / "rospack_nosubdirs", error)) return;
  for (const auto& it : fs::directory_iterator(folder, error)) {
    const bool is_hidden = it.path().filename().string()[0] == '.';
    if (!is_hidden && it.is_directory(error)) crawl(it.path(), depth - 1, packages);
  }
}

}  // namespace

std::string filePathOf(const std::string& name, const std::string& key) {
  const std::string scheme = "package://";
  if (name.rfind(scheme, 0) != 0) return name;
  const std::size_t slash = std::min(name.find('/', scheme.size()), name.size());
  const std::string package = name.substr(scheme.size(), slash - scheme.size());
  const std::string allowed =
      "; allowed: package://PACKAGE/PATH of a package in ROS_PACKAGE_PATH, or a path beside the "
      "scene";
  if (slash + 1 >= name.size()) throw SceneError(key, inQuotes(name) + " names no file" + allowed);
  std::map<std::string, fs::path> packages;
  for (const auto& [root, depth] : listRoots()) {
    crawl(root, depth, &packages);
    const auto found = packages.find(package);
    if (found != packages.end()) return (found->second / name.substr(slash + 1)).string();
  }
  std::vector<std::string> names;
  names.reserve(packages.size());
  for (const auto& it : packages) names.push_back(it.first);
  throw SceneError(key, inQuotes(name) + ": there is no package " + inQuotes(package) +
                            suggestName(package, names) + allowed);
}

}  // namespace variator_sim
