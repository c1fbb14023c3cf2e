/// Files that programs of Python write.
#pragma once

#include <string>

namespace variator_sim {

/// Runs a file of the package's Python folder, which lies beside this program, with one argument
/// and `input` on its standard input. Returns its standard output; throws OutputError with it, the
/// reason, if it fails.
std::string runPythonFile(const std::string& name, std::string argument, const std::string& input);

}  // namespace variator_sim
