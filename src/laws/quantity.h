/// The forms in which a scene may give a quantity of a law.
#pragma once

#include <string>

#include "variator_sim/component_context.h"
#include "variator_sim/expression/expression.h"

namespace variator_sim {

/// Reads the quantity at `key` of `section`, a dictionary of the component's; law_context.h lists
/// its forms and explains `range`. Throws SceneError.
Expression readQuantity(ComponentContext& context, ParameterReader& section, const std::string& key,
                        const Range& range);

}  // namespace variator_sim
