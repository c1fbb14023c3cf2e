/// Descriptions of exceptions of any type, as code of other packages may throw them.
#pragma once

#include <cxxabi.h>

#include <boost/core/demangle.hpp>
#include <exception>
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
    return "an exception of type " + boost::core::demangle(type->name()) +
           ", which is no std::exception";
  }
}

}  // namespace variator_sim
