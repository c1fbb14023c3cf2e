#include "function_table.h"

#include <algorithm>
#include <initializer_list>
#include <vector>

#include "characters.h"
#include "variator_sim/expression/parser.h"

namespace variator_sim::expression {

namespace {

template <Operation operation>
Node makeOf(Graph& graph, const Node* arguments) {
  return graph.make(operation, arguments[0],
                    operation == Operation::kAtan2 || operation == Operation::kMin ||
                            operation == Operation::kMax || operation == Operation::kPower
                        ? arguments[1]
                        : Node{});
}

Node makeClamp(Graph& graph, const Node* arguments) {
  return graph.minimum(graph.maximum(arguments[0], arguments[1]), arguments[2]);
}

constexpr Function kFunctions[] = {
    {"abs", 1, makeOf<Operation::kAbs>},     {"acos", 1, makeOf<Operation::kAcos>},
    {"asin", 1, makeOf<Operation::kAsin>},   {"atan", 1, makeOf<Operation::kAtan>},
    {"atan2", 2, makeOf<Operation::kAtan2>}, {"clamp", 3, makeClamp},
    {"cos", 1, makeOf<Operation::kCos>},     {"cosh", 1, makeOf<Operation::kCosh>},
    {"exp", 1, makeOf<Operation::kExp>},     {"if", 3, nullptr},
    {"log", 1, makeOf<Operation::kLog>},     {"max", 2, makeOf<Operation::kMax>},
    {"min", 2, makeOf<Operation::kMin>},     {"pow", 2, makeOf<Operation::kPower>},
    {"sign", 1, makeOf<Operation::kSign>},   {"sin", 1, makeOf<Operation::kSin>},
    {"sinh", 1, makeOf<Operation::kSinh>},   {"sqrt", 1, makeOf<Operation::kSqrt>},
    {"tan", 1, makeOf<Operation::kTan>},     {"tanh", 1, makeOf<Operation::kTanh>}};

}  // namespace

const Function* findFunction(const std::string& name) {
  for (const Function& function : kFunctions) {
    if (name == function.name) {
      return &function;
    }
  }
  return nullptr;
}

std::string explainForeignWord(const std::string& word) {
  const auto is_one_of = [&word](std::initializer_list<const char*> words) {
    return std::find(words.begin(), words.end(), word) != words.end();
  };
  if (is_one_of({"and", "&", "or", "|"})) {
    return "'if' takes one comparison; both hold in if(a < b, if(c < d, x, y), y), one or both in "
           "if(a < b, x, if(c < d, x, y))";
  }
  if (is_one_of({"not", "!"})) {
    return "the opposite of a comparison exchanges the two values of its 'if'";
  }
  if (!is_one_of({"integral", "integrate", "integ", "int", "cumsum"})) return "";
  return "the integral of a speed is an angle, phi_SHAFT; that of anything else is the velocity of "
         "one more shaft, {inertia: 1}, on which it acts as an ExpressionTorque (doc/modelling.md)";
}

std::vector<std::string> functionNames() {
  std::vector<std::string> names;
  for (const Function& function : kFunctions) names.emplace_back(function.name);
  return names;
}

bool isValidName(const std::string& name) {
  return !name.empty() && isNameStart(name.front()) &&
         std::all_of(name.begin(), name.end(), [](char c) { return isNameStart(c) || isDigit(c); });
}

}  // namespace variator_sim::expression
