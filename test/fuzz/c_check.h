/// Checks the vocabulary of emitted C.
#pragma once

#include <string>
#include <vector>

namespace variator_sim::fuzz {

/// The first fault of `text`, or "". Allowed are the characters and tokens that our own templates
/// have, comments that end, balanced brackets, headers of the standard library and NAME.h, and
/// calls of the standard library's functions of our choice, of `name`_.. and of functions whose
/// bodies are in `text`. No trigraphs.
std::string findFaultOfC(const std::string& text, const std::string& name);

/// Returns the compiler's messages with `options`, or "" without any (or without a compiler).
/// Started without a shell, on files in a folder of this process alone; `header` is NAME.h.
std::string compileC(const std::string& text, const std::vector<std::string>& options,
                     const std::string& name, const std::string& header);

}  // namespace variator_sim::fuzz
