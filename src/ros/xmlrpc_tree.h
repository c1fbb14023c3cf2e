/// The parameter server's values as the tree that the core reads.
#pragma once

#include <xmlrpcpp/XmlRpcValue.h>

#include <string>
#include <utility>

#include "variator_sim/parameter_tree.h"

namespace variator_sim {

/// A copy of `value`, which stands at `path` ("" for the root). An empty value becomes an empty
/// dictionary at the root and nothing elsewhere. Throws SceneError for dates and binary data.
/// (XmlRpcValue reads through non-const references only.)
inline ParameterTree toParameterTree(XmlRpc::XmlRpcValue& value, const std::string& path = "") {
  switch (value.getType()) {
    case XmlRpc::XmlRpcValue::TypeInvalid:
      return path.empty() ? ParameterTree::dictionary() : ParameterTree();
    case XmlRpc::XmlRpcValue::TypeBoolean:
      return ParameterTree::boolean(static_cast<bool&>(value));
    case XmlRpc::XmlRpcValue::TypeInt:
      return ParameterTree::integer(static_cast<int&>(value));
    case XmlRpc::XmlRpcValue::TypeDouble:
      return ParameterTree::real(static_cast<double&>(value));
    case XmlRpc::XmlRpcValue::TypeString:
      return ParameterTree::text(static_cast<std::string&>(value));
    case XmlRpc::XmlRpcValue::TypeArray: {
      ParameterTree::List list;
      for (int i = 0; i < value.size(); ++i) {
        list.push_back(toParameterTree(value[i], elementPath(path, static_cast<std::size_t>(i))));
      }
      return ParameterTree::list(std::move(list));
    }
    case XmlRpc::XmlRpcValue::TypeStruct: {
      ParameterTree::Dictionary dictionary;
      for (auto& [key, entry] : value) {
        dictionary.emplace(key, toParameterTree(entry, entryPath(path, key)));
      }
      return ParameterTree::dictionary(std::move(dictionary));
    }
    default:
      throw SceneError(path,
                       "a date or binary data stands here; a boolean, a number, a text, a "
                       "list or a dictionary is needed");
  }
}

}  // namespace variator_sim
