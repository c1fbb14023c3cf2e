#include "expression/c_code.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <map>

#include "expression/function_table.h"
#include "variator_sim/expression/tape.h"

namespace variator_sim::expression {
namespace {

/// Returns the index of each reachable node among these: the number it has in the code.
std::vector<int> rank(const std::vector<bool>& reachable) {
  std::vector<int> ranks(reachable.size(), -1);
  int next = 0;
  for (std::size_t i = 0; i < reachable.size(); ++i) {
    if (reachable[i]) ranks[i] = next++;
  }
  return ranks;
}

/// Returns the exponent of a power that is written as products; 0 for any other.
int multipliedExponent(const Graph& graph, const Graph::Entry& it) {
  const Node exponent{it.operands[1]};
  if (it.operation != Operation::kPower || !graph.isConstant(exponent)) return 0;
  const double value = graph.constantValue(exponent);
  return isMultipliedPower(value) ? static_cast<int>(value) : 0;
}

const char* sourceName(Source source) {
  switch (source) {
    case Source::kTime:
      return "t";
    case Source::kAngle:
      return "p";
    case Source::kVelocity:
      return "w";
    case Source::kAcceleration:
      return "e";
    case Source::kInput:
      return "u";
    case Source::kInputRate:
      return "v";
    case Source::kInputSecondRate:
      return "a";
    default:
      return nullptr;
  }
}

class Writer {
 public:
  Writer(const Graph& graph, std::size_t before) : graph_(graph), next_constant_(before) {}

  void write(const std::vector<Node>& outputs) {
    const std::vector<bool> reachable = graph_.findReachable(outputs);
    ranks_ = rank(reachable);
    for (std::size_t i = 0; i < reachable.size(); ++i) {
      const Graph::Entry& it = graph_.entry({static_cast<int>(i)});
      if (!reachable[i]) continue;
      if (it.operation == Operation::kConstant && !isWrittenOut(it.value)) {
        constants_[static_cast<int>(i)] = next_constant_++;
      }
      if (it.operation == Operation::kSin) sines_[it.operands[0]] = static_cast<int>(i);
      if (it.operation == Operation::kCos) cosines_[it.operands[0]] = static_cast<int>(i);
    }
    for (std::size_t i = 0; i < reachable.size(); ++i) {
      const Node node{static_cast<int>(i)};
      if (reachable[i] && operandCount(graph_.entry(node).operation) > 0) define(node);
    }
    for (std::size_t k = 0; k < outputs.size(); ++k) {
      text_ += "  y[" + std::to_string(k) + "] = " + refer(outputs[k]) + ";\n";
    }
  }
  const std::string& text() const { return text_; }

 private:
  std::string refer(Node node) const {
    const Graph::Entry& entry = graph_.entry(node);
    if (entry.operation == Operation::kConstant) {
      const auto place = constants_.find(node.index);
      return writeNumber(entry.value, place == constants_.end() ? 0 : place->second);
    }
    if (entry.operation == Operation::kVariable) {
      const Source source = sourceOf(entry.slot);
      const std::string name = sourceName(source);
      return source == Source::kTime ? name
                                     : name + "[" + std::to_string(indexOf(entry.slot)) + "]";
    }
    return "n" + std::to_string(ranks_[static_cast<std::size_t>(node.index)]);
  }

  /// Writes x^n by the same products as powerOf.
  std::string power(const std::string& base, int n) {
    if (n == 1) return base;
    if (n % 2 == 1) return "(" + power(base, n - 1) + " * " + base + ")";
    const std::string root = "q" + std::to_string(++roots_);
    const std::string half = power(base, n / 2);
    text_ += "  const double " + root + " = " + half + ";\n";
    return "(" + root + " * " + root + ")";
  }

  std::string valueOf(const Graph::Entry& it) {
    const auto operand = [&](int k) { return refer({it.operands[k]}); };
    switch (it.operation) {
      case Operation::kNegate:
        return "-" + operand(0);
      case Operation::kAdd:
        return operand(0) + " + " + operand(1);
      case Operation::kSubtract:
        return operand(0) + " - " + operand(1);
      case Operation::kMultiply:
        return operand(0) + " * " + operand(1);
      case Operation::kDivide:
        return operand(0) + " / " + operand(1);
      case Operation::kTable:
        return "T->table(T->tables[" + std::to_string(it.slot) + "], " +
               std::to_string(it.order[0]) + ", " + operand(0) + ")";
      case Operation::kTable2:
        return "T->table2(T->tables2[" + std::to_string(it.slot) + "], " +
               std::to_string(it.order[0]) + ", " + std::to_string(it.order[1]) + ", " +
               operand(0) + ", " + operand(1) + ")";
      case Operation::kPower: {
        const int n = multipliedExponent(graph_, it);
        if (n != 0) return n < 0 ? "1.0 / " + power(operand(0), -n) : power(operand(0), n);
        break;
      }
      default:
        break;
    }
    std::string call = findFunction(it.operation)->c + std::string("(");
    for (int k = 0; k < operandCount(it.operation); ++k) call += (k > 0 ? ", " : "") + operand(k);
    return call + ")";
  }

  /// Writes sine and cosine of one argument in one call; true when `node` belongs to such a pair.
  bool definePair(Node node, const Graph::Entry& it) {
    if (it.operation != Operation::kSin && it.operation != Operation::kCos) return false;
    const auto sine = sines_.find(it.operands[0]);
    const auto cosine = cosines_.find(it.operands[0]);
    if (sine == sines_.end() || cosine == cosines_.end()) return false;
    if (node.index == std::min(sine->second, cosine->second)) {
      const std::string s = refer({sine->second});
      const std::string c = refer({cosine->second});
      text_ += "  double " + s + ", " + c + ";\n  sincos(" + refer({it.operands[0]}) + ", &" + s +
               ", &" + c + ");\n";
    }
    return true;
  }

  void define(Node node) {
    const Graph::Entry it = graph_.entry(node);
    if (definePair(node, it)) return;
    const std::string value = valueOf(it);
    text_ += "  const double " + refer(node) + " = " + value + ";\n";
  }

  const Graph& graph_;
  std::string text_;
  std::vector<int> ranks_;
  std::size_t next_constant_;
  std::map<int, std::size_t> constants_;  ///< indices of constants, by node
  std::map<int, int> sines_;              ///< a sine's node, and its cosine
  std::map<int, int> cosines_;
  int roots_ = 0;
};

}  // namespace

const char* prelude() {
  return R"c(#include <math.h>

/* What the host computes is the library's: -fno-builtin. These two are exact everywhere. */
#ifdef __GNUC__
#define fabs __builtin_fabs
#define sqrt __builtin_sqrt
#endif
#ifdef __GLIBC__
void sincos(double x, double* sine, double* cosine);
#else
static inline void sincos(double x, double* sine, double* cosine) {
  *sine = sin(x);
  *cosine = cos(x);
}
#endif

struct tables {
  const double* constants;
  const void* const* tables;
  const void* const* tables2;
  double (*table)(const void* table, int order, double x);
  double (*table2)(const void* table, int order_x, int order_y, double x, double y);
};

/* A comparison with NaN has no answer, so its result is NaN. */
static inline double sign_of(double x) {
  return x > 0.0 ? 1.0 : x < 0.0 ? -1.0 : x == 0.0 ? 0.0 : x;
}
static inline double minimum_of(double a, double b) { return a <= b ? a : b < a ? b : a + b; }
static inline double maximum_of(double a, double b) { return a >= b ? a : b > a ? b : a + b; }
static inline double select_of(double a, double b, double yes, double no) {
  return a <= b ? yes : a > b ? no : NAN;
}
static inline double where_finite(double a, double value) {
  return isfinite(a) ? value : isinf(a) ? 0.0 : a;
}
)c";
}

bool isWritable(const Graph& graph, const std::vector<Node>& outputs) {
  const std::vector<int> reachable = graph.listReachable(outputs);
  return std::all_of(reachable.begin(), reachable.end(), [&](int i) {
    const Graph::Entry& it = graph.entry({i});
    return it.operation == Operation::kVariable ? sourceName(sourceOf(it.slot)) != nullptr
                                                : it.operation != Operation::kOpaque;
  });
}

bool isWrittenOut(double value) {
  return (value == 0.0 && !std::signbit(value)) || value == 1.0 || value == -1.0;
}

std::string writeNumber(double value, std::size_t place) {
  if (!isWrittenOut(value)) return "c[" + std::to_string(place) + "]";
  return value == 0.0 ? "0.0" : value > 0.0 ? "1.0" : "(-1.0)";
}

bool CodeStructure::note(double value) {
  const bool is_written_out = isWrittenOut(value);
  words.push_back(is_written_out ? static_cast<int>(value) : 2);
  if (!is_written_out) constants.push_back(value);
  return is_written_out;
}

void addStructure(const Graph& graph, const std::vector<Node>& outputs, CodeStructure* structure) {
  const std::vector<bool> reachable = graph.findReachable(outputs);
  const std::vector<int> ranks = rank(reachable);
  std::vector<int>& words = structure->words;
  for (std::size_t i = 0; i < reachable.size(); ++i) {
    if (!reachable[i]) continue;
    const Graph::Entry& it = graph.entry({static_cast<int>(i)});
    words.push_back(static_cast<int>(it.operation));
    if (it.operation == Operation::kConstant) {
      structure->note(it.value);
      continue;
    }
    words.insert(words.end(), {it.slot, it.order[0], it.order[1], multipliedExponent(graph, it)});
    for (int k = 0; k < operandCount(it.operation); ++k) {
      words.push_back(ranks[static_cast<std::size_t>(it.operands[k])]);
    }
  }
  words.push_back(-1);
  for (const Node output : outputs) words.push_back(ranks[static_cast<std::size_t>(output.index)]);
}

std::string writeFunction(const Graph& graph, const std::string& name,
                          const std::vector<Node>& outputs, std::size_t before) {
  Writer writer(graph, before);
  writer.write(outputs);
  return "\nvoid " + name +
         "(double t, const double* p, const double* w, const double* e, const double* u,\n"
         "    const double* v, const double* a, const struct tables* T, double* y) {\n"
         "  const double* const restrict c = T->constants;\n"
         "  (void)t, (void)p, (void)w, (void)e, (void)u, (void)v, (void)a, (void)c, (void)y;\n" +
         writer.text() + "}\n";
}

}  // namespace variator_sim::expression
