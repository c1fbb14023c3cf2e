#include "stress/hazard.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <limits>
#include <numeric>
#include <utility>

namespace variator_sim::test {

bool isLongForm() {
  const char* form = std::getenv("VARIATOR_SIM_STRESS");
  return form != nullptr && std::string(form) == "long";
}

std::vector<std::uint64_t> givenSeeds(int brief, int lengthy, std::uint64_t from) {
  const std::string last = testing::internal::GetArgvs().back();
  if (last.find_first_not_of("0123456789") == std::string::npos) {
    return {std::strtoull(last.c_str(), nullptr, 10)};
  }
  const auto read = [](const char* name, std::uint64_t otherwise) {
    const char* text = std::getenv(name);
    return text != nullptr ? std::strtoull(text, nullptr, 10) : otherwise;
  };
  std::vector<std::uint64_t> seeds(
      read("VARIATOR_SIM_STRESS_COUNT", static_cast<std::uint64_t>(sizeOf(brief, lengthy))));
  std::iota(seeds.begin(), seeds.end(), read("VARIATOR_SIM_STRESS_SEED", from));
  return seeds;
}

Run play(Simulation& simulation, const std::vector<double>& times,
         const std::vector<TimedCommand>& commands) {
  Run run;
  auto command = commands.begin();
  for (double time : times) {
    while (command != commands.end() && command->time <= time) {
      if (command->time > simulation.time() && !simulation.advanceTo(command->time).ok()) break;
      simulation.command(command->input, command->value);
      ++command;
    }
    simulation.advanceTo(time);
    const Sample sample = simulation.sample();
    if (!simulation.status().ok()) break;
    run.samples.push_back(sample);
  }
  run.reason = simulation.status().reason;
  run.message = simulation.describeStatus();
  run.end = simulation.time();
  run.statistics = simulation.statistics();
  return run;
}

Run play(const Scene& scene, const std::vector<double>& times,
         const std::vector<TimedCommand>& commands) {
  try {
    Simulation simulation(scene);
    return play(simulation, times, commands);
  } catch (const SceneError& error) {
    Run run;
    run.reason = StopReason::kProjectionFailed;
    run.message = error.what();
    return run;
  }
}

std::vector<double> evenly(double end, int n) {
  std::vector<double> times;
  for (int i = 1; i <= n; ++i) times.push_back(end * i / n);
  return times;
}

double calcDifference(const Run& run, const Run& reference, int shafts, double relative,
                      double absolute, Columns columns) {
  double worst = 0.0;
  double scale[3][kMaxShafts] = {};
  const std::size_t count = std::min(run.samples.size(), reference.samples.size());
  for (std::size_t n = 0; n < count; ++n) {
    const Sample& a = run.samples[n];
    const Sample& b = reference.samples[n];
    const auto compare = [&](int column, int i, double x, double y) {
      double& largest = scale[column][i];
      largest = std::max(largest, std::abs(y));
      const double error = std::abs(x - y) / (absolute + relative * largest);
      // A NaN is kept: no comparison with it is true.
      if (!(error <= worst)) worst = error == error ? std::max(error, worst) : error;
    };
    for (int i = 0; i < shafts; ++i) {
      compare(0, i, a.velocity[i], b.velocity[i]);
      if (columns != Columns::kVelocity) compare(1, i, a.acceleration[i], b.acceleration[i]);
      if (columns == Columns::kAll) compare(2, i, a.angle[i], b.angle[i]);
    }
    if (worst != worst) return worst;
  }
  return worst;
}

Hazard::Hazard(std::string hazard, std::string sweep, std::string range)
    : hazard_(std::move(hazard)), sweep_(std::move(sweep)), range_(std::move(range)) {}

Hazard::~Hazard() {
  const char* path = std::getenv("VARIATOR_SIM_STRESS_REPORT");
  if (path == nullptr) return;
  std::string stops;
  for (const auto& [name, count] : stops_) {
    stops += (stops.empty() ? "" : " ") + name + ":" + std::to_string(count);
  }
  // Semicolons separate the fields.
  const auto field = [](std::string words) {
    std::replace(words.begin(), words.end(), ';', ',');
    return words + ';';
  };
  std::ofstream(path, std::ios::app)
      << field(hazard_) << field(sweep_) << field(range_) << runs_ << ';' << text(worst_error_)
      << ';' << text(worst_) << ';' << field(worst_label_) << field(stops) << wrong_ << '\n';
}

void Hazard::judge(double error, const std::string& label, double allowed) {
  ++runs_;
  if (!(error <= allowed)) {
    fail(error, allowed, label);
  }
  const double part = error / allowed;
  if (!(part <= worst_)) {
    worst_ = part;
    worst_error_ = error;
    worst_label_ = label;
  }
}

void Hazard::fail(double error, double allowed, const std::string& label) {
  ++wrong_;
  ADD_FAILURE() << hazard_ << ", " << sweep_ << ": silently wrong at " << label << ": "
                << text(error) << " tolerances where " << text(allowed) << " are allowed";
}

void Hazard::stopped(StopReason reason, const std::string& label) {
  if (reason == StopReason::kNone) {
    fail(std::numeric_limits<double>::quiet_NaN(), 0.0, label + " (it did not stop)");
  }
  named(toString(reason), label);
}

void Hazard::named(const std::string& name, const std::string& /*label*/) {
  ++runs_;
  ++stops_[name];
}

void Hazard::compare(const Run& run, const Run& reference, const Scene& scene,
                     const std::string& label, double allowed, Columns columns) {
  const double error =
      calcDifference(run, reference, scene.shaftCount(), scene.solver.relative_tolerance,
                     scene.solver.absolute_tolerance, columns);
  if (run.reason != StopReason::kNone && error <= allowed) {
    stopped(run.reason, label);
    return;
  }
  judge(error, label, allowed);
}

int Hazard::stops() const {
  int sum = 0;
  for (const auto& [name, count] : stops_) sum += count;
  return sum;
}

std::string text(double value) {
  char buffer[32];
  std::snprintf(buffer, sizeof buffer, "%.3g", value);
  return buffer;
}

}  // namespace variator_sim::test
