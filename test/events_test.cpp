// Events whose side rounding would decide, beside those of test/known_motions.yaml: each is decided
// once.

#include "support/scenes.h"

namespace variator_sim {
namespace {

constexpr StepperKind kSteppers[] = {StepperKind::kAuto, StepperKind::kTaylor, StepperKind::kRadau,
                                     StepperKind::kDopri5, StepperKind::kFehlberg78};
constexpr const char* kPrinciples[] = {"generalized_gauss", "gauss"};

// The event is set off again by the value that it sets: w = t up to there, and no further.
TEST(AnEventThatSetsItselfOff, StopsTheMotionAtItsOwnTime) {
  for (const char* principle : kPrinciples) {
    for (const StepperKind stepper : kSteppers) {
      SCOPED_TRACE(std::string(principle) + ", " + toString(stepper));
      Simulation simulation(test::withStepper(
          test::sceneFromText("a 1", {"q on a: n"},
                              "variables: [n]\nn: {initial: 1}\nevents: [up]\n"
                              "up: {when: w_a - 0.7, direction: both, set: {n: -n}}\nprinciple: " +
                                  std::string(principle)),
          stepper));
      for (const double time : {0.1, 0.4, 0.69}) {
        ASSERT_TRUE(simulation.advanceTo(time).ok()) << simulation.describeStatus();
        EXPECT_NEAR(simulation.sample().velocity[0], time, 1e-7);
        EXPECT_NEAR(simulation.sample().reaction_torque[0], 0.0, 1e-5);
      }
      EXPECT_FALSE(simulation.advanceTo(2.0).ok());
      EXPECT_EQ(simulation.status().reason, StopReason::kChattering);
      EXPECT_NEAR(simulation.status().time, 0.7, 1e-7);
      EXPECT_NEAR(simulation.sample().velocity[0], 0.7, 1e-7);
    }
  }
}

TEST(EventsThatNobodyTakes, AreCountedOrKept) {
  constexpr int kEvents = 1909;  // zeros of the sine up to 2 s
  for (const bool keeps : {false, true}) {
    Simulation simulation(test::sceneFromText("a 1", {"q on a: 0"},
                                              "variables: [n]\nn: {initial: 0}\nevents: [turn]\n"
                                              "turn: {when: sin(3000*t), direction: both, "
                                              "set: {n: n + 1}}\n"));
    if (keeps) simulation.keepModeEvents();
    ASSERT_TRUE(simulation.advanceTo(2.0).ok()) << simulation.describeStatus();
    ModeEvent event;
    int taken = 0;
    double before = 0.0;
    for (; simulation.takeModeEvent(&event); before = event.time, ++taken) {
      EXPECT_NEAR(event.time, (keeps ? taken + 1 : taken + 1 + kEvents - 1024) * M_PI / 3000, 1e-9);
      EXPECT_GT(event.time, before);
    }
    EXPECT_EQ(taken, keeps ? kEvents : 1024);
    EXPECT_EQ(simulation.lostModeEvents(), keeps ? 0U : kEvents - 1024U);
  }
}

// A constraint switches at the instant of a command, of either order.
TEST(CommandsAtAKink, ChangeNothingThatNoLawReads) {
  for (const char* constraint :
       {"v of order 1: w2-0.5*w1-0.1*abs(t-1)", "v of order 1: w2-0.5*w1-0.1*max(0, t-1)",
        "v: e2-0.5*e1+w2-0.5*w1+0.3*abs(t-1)", "v: e2-if(t < 1, 0.5*e1, 0.5*e1+0.2*(t-1))"}) {
    const std::string yaml =
        test::sceneText("a 1, b 2", {"q on a: 2 + sign(t-1)", constraint},
                        "inputs: [unread, ramp]\nunread: {topic: unread}\n"
                        "ramp: {topic: ramp, hold: rate_limit, rate: 1}\ninitial: {project: true}");
    for (const char* principle : kPrinciples) {
      const std::string text = yaml + "principle: " + principle + "\n";
      SCOPED_TRACE(text);
      Simulation plain(test::sceneFromText(text));
      ASSERT_TRUE(plain.advanceTo(2.0).ok()) << plain.describeStatus();
      for (const StepperKind stepper : {StepperKind::kAuto, StepperKind::kFehlberg78}) {
        for (const bool ramps : {false, true}) {
          Simulation simulation(test::withStepper(test::sceneFromText(text), stepper));
          if (ramps) simulation.command(1, 1.0);  // arrives at 1 s
          ASSERT_TRUE(simulation.advanceTo(1.0).ok()) << simulation.describeStatus();
          if (!ramps) simulation.command(0, 1.0);
          ASSERT_TRUE(simulation.advanceTo(2.0).ok()) << simulation.describeStatus();
          for (int i = 0; i < 2; ++i) {
            EXPECT_NEAR(simulation.sample().velocity[i], plain.sample().velocity[i], 1e-7);
            EXPECT_NEAR(simulation.sample().acceleration[i], plain.sample().acceleration[i], 1e-6);
            EXPECT_NEAR(simulation.sample().reaction_torque[i], plain.sample().reaction_torque[i],
                        1e-6);
          }
        }
      }
    }
  }
}

}  // namespace
}  // namespace variator_sim
