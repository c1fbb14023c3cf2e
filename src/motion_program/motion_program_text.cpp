// A MotionProgram as C.
#include <set>
#include <string>
#include <vector>

#include "expression/series_dot.h"
#include "machine_code/kernel_library.h"
#include "motion_program/c_text.h"
#include "motion_program/motion_program.h"

namespace variator_sim {

std::string MotionProgram::structure() const {
  return writeExtents() + writeLists(true) + writeRows(true) + writeHiding();
}

std::string MotionProgram::writeExtents() const {
  std::string text = "enum {\n  SCENE_SHAFTS = " + std::to_string(S) +
                     ",\n  SCENE_CONSTRAINTS = " + std::to_string(CONSTRAINTS) +
                     ",\n  SCENE_INPUTS = " + std::to_string(INPUTS) +
                     ",\n  SCENE_HOLDS = " + std::to_string(HOLDS) + ",\n  SCENE_MOST_EVENTS = " +
                     std::to_string(HOLDS > 0 || EVENTS > 0 ? 64 : 1) +
                     ",\n  SCENE_STATES = " + std::to_string(STATES) +
                     ",\n  SCENE_VARIABLES = " + std::to_string(VARIABLES) +
                     ",\n  SCENE_EVENTS = " + std::to_string(EVENTS);
#define VARIATOR_SIM_WRITE(name) text += ",\n  " #name " = " + std::to_string(name);
  VARIATOR_SIM_MOTION_EXTENTS(VARIATOR_SIM_WRITE)
#undef VARIATOR_SIM_WRITE
  return text + "\n};\n";
}

std::string MotionProgram::writeLists(bool shares) const {
  std::string text =
      "enum {\n  VS_STRIDE = SCENE_STRIDE,\n  MOST_SHAFTS = SCENE_SHAFTS,\n"
      "  MOST_CONSTRAINTS = SCENE_CONSTRAINTS + SCENE_HOLDS,\n  MOST_HOLDS = SCENE_HOLDS,\n"
      "  MOST_INPUTS = SCENE_INPUTS,\n  MOST_EVENTS = SCENE_EVENTS,\n"
      "  MOST_SIZE = MOST_SHAFTS + MOST_CONSTRAINTS";
#define VARIATOR_SIM_WRITE(name) text += ",\n  " #name " = " + std::to_string(name);
  VARIATOR_SIM_MOTION_SIZES(VARIATOR_SIM_WRITE)
#undef VARIATOR_SIM_WRITE
  text += "\n};\n";
  if (shares) return text + writeSharedLists();
#define VARIATOR_SIM_WRITE(name) \
  text += "static const double " #name " = " + literalOf(name) + ";\n";
  VARIATOR_SIM_MOTION_NUMBERS(VARIATOR_SIM_WRITE)
#undef VARIATOR_SIM_WRITE
  text += "\n/* The rows of formulas, by shaft and constraint, and the commanded inputs */\n";
#define VARIATOR_SIM_WRITE(type, name) \
  text += arrayOf(#type, #name, (name).values);  // NOLINT: a member
  VARIATOR_SIM_MOTION_LISTS(VARIATOR_SIM_WRITE)
  VARIATOR_SIM_MOTION_NUMBER_LISTS(VARIATOR_SIM_WRITE)
  VARIATOR_SIM_MOTION_COMMANDS(VARIATOR_SIM_WRITE)
#undef VARIATOR_SIM_WRITE
  std::vector<std::string> names;
  for (const std::vector<double>& points : passages) {
    names.push_back("passage_" + std::to_string(names.size()));
    text += arrayOf("double", names.back(), points);
  }
  return text + arrayOf("double *const", "passage_points", names);
}

/// Writes those lists that the structure of the scene determines, and where the others are.
std::string MotionProgram::writeSharedLists() const {
  std::string text;
#define VARIATOR_SIM_WRITE(type, name) text += arrayOf(#type, #name, (name).values);
  VARIATOR_SIM_MOTION_LISTS(VARIATOR_SIM_WRITE)
#undef VARIATOR_SIM_WRITE
  return text + arrayOf("double", "timeout_of", std::vector<double>(timeout_of.values.size())) +
         R"c(#define RELATIVE_TOLERANCE it->numbers->relative_tolerance
#define ABSOLUTE_TOLERANCE it->numbers->absolute_tolerance
#define MAXIMUM_STEP m->series[0].numbers->maximum_step
#define DECAY it->numbers->decay
#define coupling it->numbers->coupling
#define constant_value m->series[0].numbers->constant_value
#define passage_points it->numbers->passage_points
#define restitution it->numbers->restitution
#define closes_below it->numbers->closes_below
#define delay_of m->series[0].numbers->delay_of
#define resolved ((const struct SeriesOperation*)it->numbers->resolved)
)c";
}

std::string MotionProgram::integersOf(const expression::SeriesOperation& it) {
  std::string text;
  for (const int n : {it.kind, it.result, it.second, it.a, it.b, it.degree, it.state, it.power}) {
    text.append(std::to_string(n)).append(", ");
  }
  return text;
}

std::string MotionProgram::writeResolution(bool shares) const {
  std::string text =
      std::string("\n/* ---- Whether the series show all of their functions. ---- */\n\n") +
      kSeriesCheck;
  if (shares) return text + writeHiding();
  text += "static const struct SeriesOperation resolved[] = {\n";
  for (const expression::SeriesOperation& it : resolved.values) {
    text += "    {" + integersOf(it) + literalOf(it.f) + ", " + literalOf(it.g) + "},\n";
  }
  return text + "    {0, 0, -1, 0, -1, 0, -1, 0, 0.0, 0.0}};\n" + writeHiding();
}

/// Writes the screen of vs_is_resolved, with the reach of each row once.
std::string MotionProgram::writeHiding() const {
  const auto row = [](int n) { return "r[" + std::to_string(n) + "]"; };
  std::string reaches;
  std::string sums;
  std::set<int> reached;
  const auto reach = [&](int n) {
    const std::string name = std::to_string(n);
    if (reached.insert(n).second) {
      reaches += "  Real u" + name + ", w" + name + " = seriesReach(" + row(n) + ", p, last, &u" +
                 name + ");\n";
    }
    return "w" + name + ", u" + name;
  };
  for (const expression::SeriesOperation& op : resolved.values) {
    if (!expression::seriesMayHide(&op, 0)) continue;
    const int b = op.b < 0 ? op.a : op.b;
    if (op.degree <= SCENE_ORDER) sums += "  if (last < " + std::to_string(op.degree) + ")\n";
    sums += "  sum += seriesHides(" + std::to_string(op.kind);
    for (const int n : {op.result, op.second, op.a, b}) sums += ", " + row(n < 0 ? op.a : n);
    sums += ", " + reach(op.kind == expression::kSeriesQuotient ? b : op.a) + ", " + reach(b) +
            ", p, last);\n";
  }
  return "\n/* 0 where no operation has more unresolved than visible terms. */\n"
         "VS_INLINE Real vs_hides(const scene_series* it, const Real* p, int last) {\n"
         "  const vs_row* const r = it->row;\n  Real sum = 0.0;\n  (void)r, (void)p, "
         "(void)last;\n" +
         reaches + sums + "  return sum;\n}\n";
}

std::string MotionProgram::writeMotion(bool shares) const {
  // A function for each order, unless a scene has so many rows that compiling them takes long: then
  // one of loops.
  constexpr int kMostRows = 200;
  std::string text = writeLists(shares);
  text += SCENE_ROWS <= kMostRows ? writeOrders(shares) : "#define VS_ORDER_VARIES\n";
  return text + kOperations + (shares ? "" : kTableData) + kTableFunctions +
         "\n/* ---- The scene's formulas: coefficients n ---- */\n" + writeRows(shares) +
         writeResolution(shares) + kMotion;
}

std::string MotionProgram::writeOrders(bool in_units) const {
  std::string each = "#define VS_EACH_ORDER(X)";
  std::string here = "#define VS_ORDERS_HERE(X)";
  std::string text;
  for (int n = 1; n <= SCENE_ORDER; ++n) {
    const std::string order = std::to_string(n);
    const std::string call = "X(" + order + ")";
    const std::string name = "VS_ORDER_" + order + "(X)";
    each.append(" ").append(call);
    here.append(" ").append(name);
    // The last unit has all else to compile.
    text.append("#if UNITS == 1 || ").append(order).append(" % (UNITS - 1) == UNIT\n#define ");
    text.append(name).append(" ").append(call).append("\n#else\n#define ");
    text.append(name).append("\n#endif\n");
  }
  if (!in_units) return "#ifndef VS_SMALL\n" + each + "\n#endif\n";
  return each + "\n" + text + here +
         "\n#define VS_ORDER_STORAGE __attribute__((visibility(\"hidden\")))\n";
}

std::string MotionProgram::writeKernel() const {
  return std::string(expression::arithmeticOfCode()) +
         "#include <float.h>\n#include <math.h>\n#include <string.h>\n" +
         // (The library's own functions, by -fno-builtin; these are exact everywhere.)
         "#ifdef __GNUC__\n#define fabs __builtin_fabs\n#define sqrt __builtin_sqrt\n"
         "#define memcpy __builtin_memcpy\n#define memset __builtin_memset\n#endif\n" +
         writeExtents() + kSceneHeader + kTableData + kExchangeData + writeMotion(true) +
         kExchange + kCommands + kHost + KernelLibrary::kLastUnit + kHostKernel +
         KernelLibrary::kEndOfUnit;
}

}  // namespace variator_sim
