/// One exception per cause, each with its evidence. The stepping loop throws none of them: it
/// returns a StopReason (status.h).
#pragma once

#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "variator_sim/message_text.h"

namespace variator_sim {

/// Base of all errors of this package: the message can be shown to a user.
class Error : public std::runtime_error {
 public:
  explicit Error(const std::string& message) : std::runtime_error(presentable(message)) {}
};

/// A scene that cannot be run as it is written. what() names the key's full path, the value, what
/// is allowed and, for a misspelt name, the nearest valid one.
class SceneError : public Error {
 public:
  SceneError(std::string key_path, std::string message)
      : Error(key_path.empty() ? message : shownPath(key_path) + ": " + message),
        key_path_(std::move(key_path)),
        message_(std::move(message)) {}

  /// Returns the key at fault, from the scene's root, e.g. "variator/parameters/tau".
  const std::string& keyPath() const { return key_path_; }
  /// Returns the fault: what() without the path.
  const std::string& message() const { return message_; }

 private:
  std::string key_path_;
  std::string message_;
};

/// Returns the index of `name` in `allowed`. Throws SceneError at `path`, which says that the name
/// `is_not` ("is not a shaft") and what is allowed.
int placeOf(const std::string& name, const std::vector<std::string>& allowed,
            const std::string& path, const std::string& is_not);

/// Returns what `work` returns; its SceneErrors tell of `source`, a file, say, before their keys.
template <class Work>
auto fromSource(const std::string& source, const Work& work) {
  try {
    return work();
  } catch (const SceneError& error) {
    throw SceneError("", source + ": " + error.what());
  }
}

}  // namespace variator_sim
