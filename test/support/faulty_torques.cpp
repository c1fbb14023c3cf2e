// A package of torques that fail, for tests of what is made of it (support/faulty_package.py).
#include <variator_sim/torque.h>

#include <chrono>
#include <memory>
#include <pluginlib/class_list_macros.hpp>
#include <stdexcept>
#include <string>
#include <thread>
#include <utility>

namespace variator_sim_faulty {

/// -w, failing once the time is above `from`, s.
class Drag : public variator_sim::OpaqueFunction {
 public:
  Drag(std::string how, double from) : OpaqueFunction(2), how_(std::move(how)), from_(from) {}
  double value(const double* x) const override {
    if (x[1] > from_) fail();
    return -x[0];
  }
  void calcGradient(const double* /*x*/, double* gradient) const override { gradient[0] = -1.0; }

 private:
  void fail() const {
    if (how_ == "throws") throw std::runtime_error("the sensor is off");
    if (how_ == "throws_a_number") throw 5;
    for (;;) std::this_thread::sleep_for(std::chrono::seconds(1));  // "blocks"
  }
  const std::string how_;
  const double from_;
};

/// Keys: `shaft`; `how` it fails; `from` when on, s, or while it is built where there is none.
class Torque : public variator_sim::Torque {
  void build(variator_sim::LawContext& scene) override {
    scene.keys({"how", "from"});
    const variator_sim::Shaft shaft = scene.shaft("shaft");
    const std::string how = scene.parameters().text("how");
    if (!scene.parameters().has("from")) throw 5;
    const double from = scene.number("from", variator_sim::Range::any("s"));
    scene.apply(shaft,
                scene.function(std::make_shared<Drag>(how, from), {shaft.velocity, scene.time()}));
  }
};

}  // namespace variator_sim_faulty

PLUGINLIB_EXPORT_CLASS(variator_sim_faulty::Torque, variator_sim::Torque)
