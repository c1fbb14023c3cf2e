// Derivatives, and the traits of growth that they need.
#include <cmath>
#include <memory>
#include <utility>

#include "expression/opaque_slope.h"
#include "variator_sim/expression/graph.h"

namespace variator_sim::expression {

namespace {

/// Returns true for powers far from their limit although the base overflows: 1e308^0.01 is 1200.
bool isSlowPower(double exponent) {
  return std::abs(exponent) < 0.1;
}

}  // namespace

// ---------------------------------------------------------------------------------------- traits

Graph::Traits Graph::findTraits(const Entry& entry) const {
  Traits all;   // traits of every operand
  Traits some;  // traits of at least one operand
  all.is_positive = all.is_not_negative = true;
  // A select only compares its first two operands.
  const int first = entry.operation == Operation::kSelect ? 2 : 0;
  for (int i = first; i < operandCount(entry.operation); ++i) {
    const Traits& operand = traits({entry.operands[i]});
    all.is_positive = all.is_positive && operand.is_positive;
    all.is_not_negative = all.is_not_negative && operand.is_not_negative;
    some.is_positive = some.is_positive || operand.is_positive;
    some.is_not_negative = some.is_not_negative || operand.is_not_negative;
    some.has_growth = some.has_growth || operand.has_growth;
    some.may_overflow = some.may_overflow || operand.may_overflow;
    some.may_have_pole = some.may_have_pole || operand.may_have_pole;
  }
  Traits made = some;
  findSign(entry, all, some, &made);
  findGrowth(entry, &made);
  return made;
}

void Graph::findSign(const Entry& entry, const Traits& all, const Traits& some,
                     Traits* made) const {
  made->is_positive = made->is_not_negative = false;
  switch (entry.operation) {
    case Operation::kConstant:
      made->is_positive = entry.value > 0.0;
      made->is_not_negative = entry.value >= 0.0;
      break;
    case Operation::kAdd:
      made->is_positive = some.is_positive && all.is_not_negative;
      made->is_not_negative = all.is_not_negative;
      break;
    case Operation::kMultiply:
      made->is_positive = all.is_positive;
      made->is_not_negative = all.is_not_negative || entry.operands[0] == entry.operands[1];
      break;
    case Operation::kDivide:
    case Operation::kMin:
    case Operation::kSelect:
      made->is_positive = all.is_positive;
      made->is_not_negative = all.is_not_negative;
      break;
    case Operation::kPower:
      made->is_positive = made->is_not_negative = traits({entry.operands[0]}).is_positive;
      break;
    case Operation::kExp:
    case Operation::kCosh:
      made->is_positive = made->is_not_negative = true;
      break;
    case Operation::kSqrt:
    case Operation::kAbs:
      made->is_positive = all.is_positive;
      made->is_not_negative = true;
      break;
    case Operation::kMax:
      made->is_positive = some.is_positive;
      made->is_not_negative = some.is_not_negative;
      break;
    default:  // variables, differences, ..: of any sign
      break;
  }
}

void Graph::findGrowth(const Entry& entry, Traits* made) const {
  const auto grow = [made] {
    made->has_growth = made->may_overflow = true;
    made->may_have_pole = false;  // growth outweighs a pole in the argument
  };
  const auto stayBounded = [made] { made->may_overflow = made->may_have_pole = false; };
  switch (entry.operation) {
    case Operation::kDivide: {
      const Node divisor = {entry.operands[1]};
      if (!traits(divisor).is_positive && !isConstant(divisor)) made->may_have_pole = true;
      break;
    }
    case Operation::kPower: {
      const bool may_be_zero = !traits({entry.operands[0]}).is_positive;
      const Node exponent = {entry.operands[1]};
      if (!isConstant(exponent)) {
        grow();
        made->may_have_pole = may_be_zero;
      } else if (isSlowPower(constantValue(exponent)) ||
                 (constantValue(exponent) < 0.0 && may_be_zero)) {
        made->may_have_pole = true;
      }
      break;
    }
    case Operation::kExp:
    case Operation::kCosh:
    case Operation::kSinh:
      grow();
      break;
    case Operation::kSin:
    case Operation::kCos:
    case Operation::kAsin:
    case Operation::kAcos:
    case Operation::kAtan:
    case Operation::kAtan2:
    case Operation::kTanh:
    case Operation::kSign:
      stayBounded();
      break;
    case Operation::kTable:
    case Operation::kTable2:
      if (tableOf(entry)->isBounded()) stayBounded();
      break;
    case Operation::kLog:
    case Operation::kOpaque:  // not known otherwise
      made->may_have_pole = true;
      break;
    default:
      break;
  }
}

// ----------------------------------------------------------------------------------- derivatives

// A zero here is a derivative that vanishes by the rules at every point: dropping its product keeps
// the true derivative even if the other factor is infinite or NaN (the formula itself is NaN or
// infinite there). multiply() leaves a zero that the user wrote to run time.
Node Graph::product(Node a, Node b) {
  if (isConstant(a, 0.0) || isConstant(b, 0.0)) return constant(0.0);
  if (isConstant(b)) std::swap(a, b);
  // c1 (c2 x) = (c1 c2) x: this changes the rounding of derivatives only.
  if (isConstant(a) && entry(b).operation == Operation::kMultiply && isConstant(operand(b, 0))) {
    const double factor = constantValue(a) * constantValue(operand(b, 0));
    if (std::isnormal(factor)) return multiply(constant(factor), operand(b, 1));
  }
  return multiply(a, b);
}

Node Graph::quotient(Node a, Node b) {
  return isConstant(a, 0.0) ? constant(0.0) : divide(a, b);
}

Node Graph::difference(Node a, Node b) {
  return a == b ? constant(0.0) : subtract(a, b);
}

Node Graph::whereFinite(Node node, Node value) {
  return isConstant(value, 0.0) ? value : make(Operation::kWhereFinite, node, value);
}

// 1/b, atan(b), b^-2, .. with b = 1 + exp(x): once b has overflowed they are at their limit, to all
// digits, for every x. A pole is different: 1/(1/x) is x at 0, too. So the rule excludes every b
// that may have one.
Node Graph::insideLimit(Node node, Node derivative) {
  const Traits& it = traits(node);
  return it.may_overflow && !it.may_have_pole ? whereFinite(node, derivative) : derivative;
}

// The scale is a power of two, which does not round. exp(x) x' is finite as long as exp(x) is, for
// x' up to 1e30; third derivatives, scaled by its cube, keep their digits down to 1e-217.
double Graph::scaleFor(Node node) const {
  return traits(node).has_growth ? 0x1p-100 : 1.0;
}

Node Graph::deriveFunction(Node node, Node da) {
  if (isConstant(da, 0.0)) return da;
  const Node a = operand(node, 0);
  const Operation operation = entry(node).operation;
  const bool has_limit = operation == Operation::kAtan || operation == Operation::kTanh ||
                         operation == Operation::kExp;
  if (has_limit) da = insideLimit(a, da);
  const Node one = constant(1.0);
  switch (operation) {
    case Operation::kSin:  // cos(a) a'
      return product(make(Operation::kCos, a), da);
    case Operation::kCos:  // -sin(a) a'
      return negate(product(make(Operation::kSin, a), da));
    case Operation::kTan:  // (1 + tan(a)^2) a'
      return product(add(one, multiply(node, node)), da);
    case Operation::kAsin:  // a' / sqrt((1 - a)(1 + a)): no cancellation near |a| = 1
      return quotient(da, make(Operation::kSqrt, multiply(subtract(one, a), add(one, a))));
    case Operation::kAcos:
      return negate(quotient(da, make(Operation::kSqrt, multiply(subtract(one, a), add(one, a)))));
    case Operation::kAtan:  // a' / (1 + a^2)
      return quotient(da, add(one, multiply(a, a)));
    case Operation::kSinh:
      return product(make(Operation::kCosh, a), da);
    case Operation::kCosh:
      return product(make(Operation::kSinh, a), da);
    case Operation::kTanh:  // (1 - tanh(a)^2) a': exact to round-off of 1, and tanh is at hand
      return product(subtract(one, multiply(node, node)), da);
    case Operation::kExp:
      return product(node, da);
    case Operation::kLog:  // a' / a
      return quotient(da, a);
    case Operation::kSqrt:  // a' / (2 sqrt(a))
      return quotient(product(constant(0.5), da), node);
    case Operation::kAbs:
      return product(make(Operation::kSign, a), da);
    default:  // sign: 0 away from its jump
      return constant(0.0);
  }
}

Node Graph::derivePower(Node node, Node da, Node db) {
  const Node a = operand(node, 0);
  const Node b = operand(node, 1);
  // (a^b)' = b a^(b-1) a' + a^b log(a) b'. A term is added only if its derivative is not zero by
  // the rules: a^c has a derivative also at a <= 0, although log(a) has no value.
  Node derivative = constant(0.0);
  if (isConstant(b) && !isSlowPower(constantValue(b))) da = insideLimit(a, da);
  db = insideLimit(b, db);
  if (!isConstant(da, 0.0)) {
    const Node slope = product(b, power(a, subtract(b, constant(1.0))));
    derivative = product(slope, da);
  }
  if (!isConstant(db, 0.0)) {
    derivative = add(derivative, product(node, product(make(Operation::kLog, a), db)));
  }
  return derivative;
}

Node Graph::deriveTable(const Entry& it, Node da, Node db) {
  const Node a = {it.operands[0]};
  const Node b = {it.operands[1]};
  const std::shared_ptr<const Table> of = tableOf(it);
  const bool has_two = it.operation == Operation::kTable2;
  if (of->isBounded()) da = insideLimit(a, da);
  if (of->isBounded() && has_two) db = insideLimit(b, db);
  const Node by_b = has_two ? product(table(of, a, b, {it.order[0], it.order[1] + 1}), db) : db;
  return add(product(table(of, a, b, {it.order[0] + 1, it.order[1]}), da), by_b);
}

std::shared_ptr<const OpaqueFunction> Graph::slopeOf(
    const std::shared_ptr<const OpaqueFunction>& function, int by) {
  for (const std::shared_ptr<const OpaqueFunction>& known : functions_) {
    const auto* slope = dynamic_cast<const OpaqueSlope*>(known.get());
    if (slope != nullptr && slope->is(function.get(), by)) return known;
  }
  return std::make_shared<const OpaqueSlope>(function, by);
}

Node Graph::deriveOpaque(const Entry& it, const Derivatives& derivatives) {
  const std::shared_ptr<const OpaqueFunction> function = opaqueOf(it);
  const Node arguments[4] = {
      {it.operands[0]}, {it.operands[1]}, {it.operands[2]}, {it.operands[3]}};
  Node sum = constant(0.0);
  for (int i = 0; i < function->argumentCount(); ++i) {
    sum = add(sum, product(opaque(slopeOf(function, i + 1), arguments),
                           derivatives[static_cast<std::size_t>(it.operands[i])]));
  }
  return sum;
}

Node Graph::deriveOne(Node node, const std::vector<Rate>& rates, const Derivatives& derivatives) {
  const Entry it = entry(node);  // a copy: making nodes moves the entries
  const auto derivative_of = [&](int position) {
    return derivatives[static_cast<std::size_t>(it.operands[position])];
  };
  const Node a = {it.operands[0]};
  const Node b = {it.operands[1]};
  switch (it.operation) {
    case Operation::kConstant:
      return constant(0.0);
    case Operation::kVariable: {
      Node rate = constant(0.0);
      for (const Rate& candidate : rates) {
        if (candidate.first == it.slot) rate = add(rate, candidate.second);
      }
      return rate;
    }
    case Operation::kNegate:
      return negate(derivative_of(0));
    case Operation::kAdd:
      return add(derivative_of(0), derivative_of(1));
    case Operation::kSubtract:
      return difference(derivative_of(0), derivative_of(1));
    case Operation::kMultiply:
      if (a == b) return product(constant(2.0), product(a, derivative_of(0)));
      return add(product(derivative_of(0), b), product(a, derivative_of(1)));
    case Operation::kDivide:  // q = a/b: q' = (a' - q b')/b
      return quotient(difference(derivative_of(0), product(node, insideLimit(b, derivative_of(1)))),
                      b);
    case Operation::kPower:
      return derivePower(node, derivative_of(0), derivative_of(1));
    case Operation::kAtan2:  // (b a' - a b')/(a^2 + b^2)
      return quotient(difference(product(b, insideLimit(a, derivative_of(0))),
                                 product(a, insideLimit(b, derivative_of(1)))),
                      add(multiply(a, a), multiply(b, b)));
    case Operation::kTable:
      return deriveTable(it, derivative_of(0), constant(0.0));
    case Operation::kTable2:
      return deriveTable(it, derivative_of(0), derivative_of(1));
    case Operation::kOpaque:
      return deriveOpaque(it, derivatives);
    case Operation::kWhereFinite:
      return whereFinite(a, derivative_of(1));
    case Operation::kMin:
      return select(a, b, derivative_of(0), derivative_of(1));
    case Operation::kMax:
      return select(b, a, derivative_of(0), derivative_of(1));
    case Operation::kSelect:
      return select(a, b, derivative_of(2), derivative_of(3));
    default:
      return deriveFunction(node, derivative_of(0));
  }
}

void Graph::deriveInto(Node node, const std::vector<Rate>& rates, Derivatives& derivatives) {
  const auto count = static_cast<std::size_t>(node.index) + 1;
  if (derivatives.size() < count) derivatives.resize(count);
  if (derivatives[count - 1].index >= 0) return;
  for (const int i : listReachable({node})) {
    Node& derivative = derivatives[static_cast<std::size_t>(i)];
    if (derivative.index < 0) derivative = deriveOne({i}, rates, derivatives);
  }
}

Node Graph::differentiate(Node node, int slot) {
  const double scale = scaleFor(node);
  // The table is moved out: no call below may see it half-filled.
  Derivatives derivatives = std::move(partials_[{slot, scale}]);
  deriveInto(node, {{slot, constant(scale)}}, derivatives);
  const Node derivative = derivatives[static_cast<std::size_t>(node.index)];
  partials_[{slot, scale}] = std::move(derivatives);
  return product(constant(1.0 / scale), derivative);
}

Node Graph::totalDerivative(Node node, const std::vector<Rate>& rates) {
  const double scale = scaleFor(node);
  std::vector<Rate> scaled;
  scaled.reserve(rates.size());
  for (const Rate& rate : rates) {
    scaled.emplace_back(rate.first, product(constant(scale), rate.second));
  }
  Derivatives derivatives;
  deriveInto(node, scaled, derivatives);
  return product(constant(1.0 / scale), derivatives[static_cast<std::size_t>(node.index)]);
}

}  // namespace variator_sim::expression
