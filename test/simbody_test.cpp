// Simbody, a multibody library of others, as a peer: shafts are pin joints, a linear constraint of
// order 2 is its acceleration-only constraint with multipliers of its own. Same accelerations as
// the principle `gauss`, which for linear constraints is equation [17].
#include <Simbody.h>

#include "support/scenes.h"

namespace variator_sim {
namespace {

constexpr int kShafts = 3;
constexpr double kInertia[kShafts] = {0.8, 2.0, 0.5};  // kg m^2

/// C(t) epsilon + b(t, phi, omega) = 0, written by hand.
struct Row {
  std::function<double(double t, int shaft)> C;
  std::function<double(double t, const double* phi, const double* omega)> b;
};

class AccelerationOnly : public SimTK::Constraint::Custom::Implementation {
 public:
  AccelerationOnly(SimTK::SimbodyMatterSubsystem& matter,
                   const std::vector<SimTK::MobilizedBody>& bodies, std::vector<Row> rows)
      : Implementation(matter, 0, 0, static_cast<int>(rows.size())), rows_(std::move(rows)) {
    for (const SimTK::MobilizedBody& body : bodies)
      shafts_.push_back(addConstrainedMobilizer(body));
  }
  Implementation* clone() const override { return new AccelerationOnly(*this); }

  void calcAccelerationErrors(
      const SimTK::State& state,
      const SimTK::Array_<SimTK::SpatialVec, SimTK::ConstrainedBodyIndex>& /*bodies*/,
      const SimTK::Array_<SimTK::Real, SimTK::ConstrainedUIndex>& acceleration,
      SimTK::Array_<SimTK::Real>& error) const override {
    double phi[kShafts];
    double omega[kShafts];
    for (int i = 0; i < kShafts; ++i) {
      phi[i] = getOneQFromState(state, shafts_[i], SimTK::MobilizerQIndex(0));
      omega[i] = getOneUFromState(state, shafts_[i], SimTK::MobilizerUIndex(0));
    }
    for (int m = 0; m < static_cast<int>(rows_.size()); ++m) {
      error[m] = rows_[m].b(state.getTime(), phi, omega);
      for (int i = 0; i < kShafts; ++i) {
        error[m] += rows_[m].C(state.getTime(), i) *
                    getOneUDot(state, acceleration, shafts_[i], SimTK::MobilizerUIndex(0));
      }
    }
  }

  void addInAccelerationConstraintForces(
      const SimTK::State& state, const SimTK::Array_<SimTK::Real>& multipliers,
      SimTK::Array_<SimTK::SpatialVec, SimTK::ConstrainedBodyIndex>& /*bodies*/,
      SimTK::Array_<SimTK::Real, SimTK::ConstrainedUIndex>& forces) const override {
    for (int m = 0; m < static_cast<int>(rows_.size()); ++m) {
      for (int i = 0; i < kShafts; ++i) {
        addInOneMobilityForce(state, shafts_[i], SimTK::MobilizerUIndex(0),
                              multipliers[m] * rows_[m].C(state.getTime(), i), forces);
      }
    }
  }

 private:
  std::vector<Row> rows_;
  std::vector<SimTK::ConstrainedMobilizerIndex> shafts_;
};

/// The drivetrain as Simbody sees it.
class Peer {
 public:
  explicit Peer(std::vector<Row> rows)
      : matter_(system_), forces_(system_), torques_(forces_, matter_) {
    for (double inertia : kInertia) {
      // Only the inertia about the pin's axis z counts.
      const SimTK::Body::Rigid body(
          SimTK::MassProperties(1.0, SimTK::Vec3(0.0), SimTK::Inertia(inertia, inertia, inertia)));
      shafts_.push_back(SimTK::MobilizedBody::Pin(matter_.Ground(), SimTK::Transform(), body,
                                                  SimTK::Transform()));
    }
    SimTK::Constraint::Custom constraint(new AccelerationOnly(matter_, shafts_, std::move(rows)));
    state_ = system_.realizeTopology();
    system_.realizeModel(state_);
  }

  /// Accelerations and the constraints' torques at the sample's time, angles, velocities and
  /// applied torques.
  void solve(const Sample& sample, double* epsilon, double* reaction) {
    state_.setTime(sample.time);
    for (int i = 0; i < kShafts; ++i) {
      shafts_[i].setOneQ(state_, 0, sample.angle[i]);
      shafts_[i].setOneU(state_, 0, sample.velocity[i]);
      torques_.setOneMobilityForce(state_, shafts_[i], SimTK::MobilizerUIndex(0),
                                   sample.applied_torque[i]);
    }
    system_.realize(state_, SimTK::Stage::Acceleration);
    for (int i = 0; i < kShafts; ++i) {
      epsilon[i] = shafts_[i].getOneUDot(state_, 0);
      reaction[i] = kInertia[i] * epsilon[i] - sample.applied_torque[i];
    }
  }

 private:
  SimTK::MultibodySystem system_;
  SimTK::SimbodyMatterSubsystem matter_;
  SimTK::GeneralForceSubsystem forces_;
  SimTK::Force::DiscreteForces torques_;
  std::vector<SimTK::MobilizedBody> shafts_;
  SimTK::State state_;
};

double ratio(double t) {
  return 0.6 + 0.1 * std::sin(0.7 * t);
}

const char* const kSlip =
    "0.2*(e2-(0.6+0.1*sin(0.7*t))*e1)+w2-(0.6+0.1*sin(0.7*t))*w1+0.3*sin(phi1)";
Row slipRow() {
  return {[](double t, int i) {
            const double C[kShafts] = {-0.2 * ratio(t), 0.2, 0.0};
            return C[i];
          },
          [](double t, const double* phi, const double* w) {
            return w[1] - ratio(t) * w[0] + 0.3 * std::sin(phi[0]);
          }};
}

const char* const kSum = "(1+0.3*cos(t))*e3-0.4*e2+0.5*e1+0.1*w3-0.002*w1*w2+0.2*cos(2*t)";
Row sumRow() {
  return {[](double t, int i) {
            const double C[kShafts] = {0.5, -0.4, 1.0 + 0.3 * std::cos(t)};
            return C[i];
          },
          [](double t, const double* /*phi*/, const double* w) {
            return 0.1 * w[2] - 0.002 * w[0] * w[1] + 0.2 * std::cos(2.0 * t);
          }};
}

/// The scene along its own motion; at each state Simbody is asked.
void expectSameAccelerations(const std::vector<std::string>& expressions, std::vector<Row> rows) {
  std::vector<std::string> elements = {"motor on a: 12*((50-w1)/50)/(((50-w1)/50)^2+0.04)",
                                       "propeller on b: -0.02*w2^2",
                                       "spring on c: -3*phi3-w3+sin(5*t)"};
  for (std::size_t m = 0; m < expressions.size(); ++m) {
    elements.push_back("constraint" + std::to_string(m) + ": " + expressions[m]);
  }
  Simulation simulation(
      test::withTolerance(test::sceneFromText("a 0.8, b 2, c 0.5", elements,
                                              "principle: gauss\ninitial: {velocity: [5, 3, 1]}"),
                          1e-10));
  Peer peer(std::move(rows));
  double largest_reaction = 0.0;
  for (int n = 0; n <= 40; ++n) {
    ASSERT_TRUE(simulation.advanceTo(0.25 * n).ok()) << simulation.describeStatus();
    const Sample& sample = simulation.sample();
    double epsilon[kShafts];
    double reaction[kShafts];
    peer.solve(sample, epsilon, reaction);
    for (int i = 0; i < kShafts; ++i) {
      ASSERT_NEAR(sample.acceleration[i], epsilon[i], 1e-9 * std::max(1.0, std::abs(epsilon[i])))
          << "shaft " << i << " at " << sample.time << " s";
      ASSERT_NEAR(sample.reaction_torque[i], reaction[i],
                  1e-9 * std::max(1.0, std::abs(reaction[i])))
          << "shaft " << i << " at " << sample.time << " s";
      largest_reaction = std::max(largest_reaction, std::abs(reaction[i]));
    }
  }
  EXPECT_GT(largest_reaction, 1.0);  // the constraints did something
}

TEST(Simbody, OneLinearConstraintOfOrder2) {
  expectSameAccelerations({kSlip}, {slipRow()});
}

TEST(Simbody, TwoLinearConstraintsOfOrder2) {
  expectSameAccelerations({kSlip, kSum}, {slipRow(), sumRow()});
}

}  // namespace
}  // namespace variator_sim
