#include "function_table.h"

#include <vector>

#include "variator_sim/expression/parser.h"

namespace variator_sim::expression {

namespace {

constexpr Function kFunctions[] = {
    {"abs", Operation::kAbs},   {"acos", Operation::kAcos},   {"asin", Operation::kAsin},
    {"atan", Operation::kAtan}, {"atan2", Operation::kAtan2}, {"cos", Operation::kCos},
    {"cosh", Operation::kCosh}, {"exp", Operation::kExp},     {"log", Operation::kLog},
    {"max", Operation::kMax},   {"min", Operation::kMin},     {"pow", Operation::kPower},
    {"sign", Operation::kSign}, {"sin", Operation::kSin},     {"sinh", Operation::kSinh},
    {"sqrt", Operation::kSqrt}, {"tan", Operation::kTan},     {"tanh", Operation::kTanh}};

}  // namespace

const Function* findFunction(const std::string& name) {
  for (const Function& function : kFunctions) {
    if (name == function.name) {
      return &function;
    }
  }
  return nullptr;
}

std::vector<std::string> functionNames() {
  std::vector<std::string> names;
  for (const Function& function : kFunctions) {
    names.emplace_back(function.name);
  }
  return names;
}

}  // namespace variator_sim::expression
