#include "function_table.h"

#include <algorithm>
#include <initializer_list>
#include <iterator>
#include <vector>

#include "characters.h"
#include "variator_sim/expression/parser.h"

namespace variator_sim::expression {

namespace {

constexpr Function kFunctions[] = {{"abs", 1, Operation::kAbs, ""},
                                   {"acos", 1, Operation::kAcos, "\\arccos"},
                                   {"asin", 1, Operation::kAsin, "\\arcsin"},
                                   {"atan", 1, Operation::kAtan, "\\arctan"},
                                   {"atan2", 2, Operation::kAtan2, "\\operatorname{atan2}"},
                                   {"clamp", 3, Operation::kConstant, ""},
                                   {"cos", 1, Operation::kCos, "\\cos"},
                                   {"cosh", 1, Operation::kCosh, "\\cosh"},
                                   {"exp", 1, Operation::kExp, "\\exp"},
                                   {"if", 3, Operation::kSelect, ""},
                                   {"log", 1, Operation::kLog, "\\ln"},
                                   {"max", 2, Operation::kMax, "\\max"},
                                   {"min", 2, Operation::kMin, "\\min"},
                                   {"pow", 2, Operation::kPower, ""},
                                   {"sign", 1, Operation::kSign, "\\operatorname{sgn}"},
                                   {"sin", 1, Operation::kSin, "\\sin"},
                                   {"sinh", 1, Operation::kSinh, "\\sinh"},
                                   {"sqrt", 1, Operation::kSqrt, ""},
                                   {"tan", 1, Operation::kTan, "\\tan"},
                                   {"tanh", 1, Operation::kTanh, "\\tanh"}};

template <class Is>
const Function* find(Is is) {
  const auto* const found = std::find_if(std::begin(kFunctions), std::end(kFunctions), is);
  return found == std::end(kFunctions) ? nullptr : found;
}

}  // namespace

const Function* findFunction(const std::string& name) {
  return find([&](const Function& it) { return name == it.name; });
}

const Function* findFunction(Operation operation) {
  return find([&](const Function& it) { return operation == it.operation; });
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
  if (is_one_of({"delay", "delayed", "transport_delay"})) {
    return "the value of x from 0.2 s ago is delay(x, 0.2), in formulas of scenes";
  }
  if (!is_one_of({"integral", "integrate", "integ", "int", "cumsum"})) return "";
  return "the integral of a speed is an angle, phi_SHAFT; that of anything else is a state of the "
         "scene, states: [z] with z: {rate: FORMULA} (doc/scene.md); over a run it is the metric "
         "integral(COLUMN) of a sweep";
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
