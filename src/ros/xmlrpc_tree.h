/// The parameter server's values as the tree that the core reads.
#pragma once

#include <xmlrpcpp/XmlRpcValue.h>

#include <string>

#include "variator_sim/parameter_tree.h"

namespace variator_sim {

/// A copy of `value`, which stands at `path` ("" for the root). An empty value becomes an empty
/// dictionary at the root and nothing elsewhere. Throws SceneError for dates and binary data.
ParameterTree toParameterTree(const XmlRpc::XmlRpcValue& value, const std::string& path = "");

}  // namespace variator_sim
