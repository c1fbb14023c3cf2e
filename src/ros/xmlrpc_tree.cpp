#include "ros/xmlrpc_tree.h"

#include <utility>

namespace variator_sim {
namespace {

ParameterTree convert(XmlRpc::XmlRpcValue& value, const std::string& path) {
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
        list.push_back(convert(value[i], elementPath(path, static_cast<std::size_t>(i))));
      }
      return ParameterTree::list(std::move(list));
    }
    case XmlRpc::XmlRpcValue::TypeStruct: {
      ParameterTree::Dictionary dictionary;
      for (auto& [key, entry] : value) {
        dictionary.emplace(key, convert(entry, entryPath(path, key)));
      }
      return ParameterTree::dictionary(std::move(dictionary));
    }
    default:
      throw SceneError(path,
                       "a date or binary data stands here; a boolean, a number, a text, a "
                       "list or a dictionary is needed");
  }
}

}  // namespace

ParameterTree toParameterTree(const XmlRpc::XmlRpcValue& value, const std::string& path) {
  // XmlRpcValue reads through non-const references only: walk over a copy.
  XmlRpc::XmlRpcValue copy = value;
  return convert(copy, path);
}

}  // namespace variator_sim
