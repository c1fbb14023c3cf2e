/// One exception per cause, each with its evidence. The stepping loop throws none of them: it
/// returns a StopReason (status.h).
#pragma once

#include <stdexcept>
#include <string>

namespace variator_sim {

/// A scene that cannot be run as it is written. what() names the key's full path, the value, what
/// is allowed and, for a misspelt name, the nearest valid one.
class SceneError : public std::runtime_error {
 public:
  SceneError(const std::string& key_path, const std::string& message)
      : std::runtime_error(key_path.empty() ? message : key_path + ": " + message),
        key_path_(key_path) {}

  /// The key at fault, from the scene's root, e.g. "variator/parameters/tau".
  const std::string& keyPath() const { return key_path_; }

 private:
  std::string key_path_;
};

}  // namespace variator_sim
