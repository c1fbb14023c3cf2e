/// Descriptions of exceptions of any type, as code of other packages may throw them.
#pragma once

#include <cxxabi.h>

#include <cstdlib>
#include <exception>
#include <memory>
#include <string>
#include <typeinfo>

#include "variator_sim/message_text.h"

namespace variator_sim {

/// Describes the exception that is being handled, for `catch (...)`: its message, or the name of
/// its type where it is no std::exception.
inline std::string describeThrown() {
  try {
    throw;
  } catch (const std::exception& error) {
    return presentable(error.what());
  } catch (...) {
    const std::type_info* const type = abi::__cxa_current_exception_type();
    if (type == nullptr) return "an exception of an unknown type";
    const std::unique_ptr<char, void (*)(void*)> name(
        abi::__cxa_demangle(type->name(), nullptr, nullptr, nullptr), std::free);
    return std::string("an exception of type ") + (name ? name.get() : type->name()) +
           ", which is no std::exception";
  }
}

}  // namespace variator_sim
