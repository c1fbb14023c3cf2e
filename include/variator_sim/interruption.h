/// How a long computation is ended from outside.
#pragma once

#include <functional>

namespace variator_sim {

/// Asked again and again; true: what is under way is to return soon. It has to be cheap.
using Interruption = std::function<bool()>;

}  // namespace variator_sim
