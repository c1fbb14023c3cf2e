/// ROS packages by their names.
#pragma once

#include <string>

namespace variator_sim {

/// Returns the path of a file: `name` itself, or of package://PACKAGE/PATH the file of a package,
/// found by the name in its package.xml as rospack does: in the folders of ROS_PACKAGE_PATH and
/// below, then in source and install spaces of CMAKE_PREFIX_PATH. Throws SceneError at `key`.
std::string filePathOf(const std::string& name, const std::string& key);

}  // namespace variator_sim
