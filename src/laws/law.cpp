#include "variator_sim/law.h"

#include "variator_sim/expression/guards.h"

namespace variator_sim {

void Law::configure(ComponentContext& context) {
  name_ = context.name();
  shaft_count_ = context.shaftCount();
  graph_ = context.graph();
  LawContext law(context);
  build(law);
  holdings_ = law.holdings();
  derive(law, context);
  outputs_ = NamedOutputs(law);
}

void Law::findEvents() {
  guards_ = expression::findGuards(*graph_, formulas_);
  instants_ = expression::findInstants(*graph_, formulas_);
}

}  // namespace variator_sim
