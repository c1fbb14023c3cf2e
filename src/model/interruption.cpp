#include "variator_sim/interruption.h"

#include <utility>

namespace variator_sim {
namespace {

thread_local const Interruption* innermost = nullptr;

}  // namespace

Interruption::Interruption(std::function<bool()> is_wanted)
    : is_wanted_(std::move(is_wanted)), outer_(std::exchange(innermost, this)) {}

Interruption::~Interruption() {
  innermost = outer_;
}

bool Interruption::isWanted() {
  return innermost != nullptr && innermost->is_wanted_();
}

}  // namespace variator_sim
