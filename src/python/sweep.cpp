#include "python/sweep.h"

#include <algorithm>
#include <array>
#include <atomic>
#include <chrono>
#include <cmath>
#include <condition_variable>
#include <exception>
#include <limits>
#include <memory>
#include <mutex>
#include <new>
#include <thread>

#include "model/thrown.h"
#include "variator_sim/errors.h"
#include "variator_sim/interruption.h"
#include "variator_sim/io/override_text.h"
#include "variator_sim/overrides.h"

namespace variator_sim::python {
namespace {

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

double calcSettlingTime(const std::vector<double>& rows, std::size_t width, std::size_t column,
                        double band) {
  const std::size_t count = rows.size() / width;
  const double last = rows[(count - 1) * width + column];
  const double allowed = band * std::abs(last - rows[column]);
  std::size_t settled = count - 1;
  while (settled > 0 && std::abs(rows[(settled - 1) * width + column] - last) <= allowed) --settled;
  return rows[settled * width] - rows[0];
}

double calcIntegral(const std::vector<double>& rows, std::size_t width, std::size_t column) {
  double integral = 0.0;
  for (std::size_t i = width; i < rows.size(); i += width) {
    integral += 0.5 * (rows[i + column] + rows[i - width + column]) * (rows[i] - rows[i - width]);
  }
  return integral;
}

double calcMean(const std::vector<double>& rows, std::size_t width, std::size_t column) {
  const double span = rows[rows.size() - width] - rows[0];
  return span > 0.0 ? calcIntegral(rows, width, column) / span : rows[column];
}

/// Machine code of some runs, never moved, which all rows share. A scene in which two numbers
/// happen to be equal has other formulas than one in which they differ, so there are a few.
class CodeOfRows {
 public:
  explicit CodeOfRows(bool compiles) : compiles_(compiles) {}

  void giveTo(Simulation& simulation) {
    const std::size_t ready = ready_;
    for (std::size_t i = 0; i < ready; ++i) {
      if (simulation.shareMachineCode(*owners_[i])) return;
    }
    if (ready == kMost) return;
    // Rows that start during a compilation are interpreted.
    const std::unique_lock<std::mutex> lock(mutex_, std::try_to_lock);
    if (!lock.owns_lock() || tried_ == kMost || ready_ != ready) return;
    ++tried_;
    auto owner = std::make_unique<Simulation>(simulation.scene(), simulation);
    const bool always = owner->scene().solver.machine_code == MachineCode::kAlways;
    if (!owner->loadMachineCode(compiles_ || always)) return;
    simulation.shareMachineCode(*owner);
    owners_[ready] = std::move(owner);
    ++ready_;
  }

 private:
  static constexpr std::size_t kMost = 4;
  const bool compiles_;
  std::mutex mutex_;
  std::size_t tried_ = 0;
  std::array<std::unique_ptr<Simulation>, kMost> owners_;
  std::atomic<std::size_t> ready_{0};
};

/// Makes the simulations of rows, for one thread; reads only changed values if that suffices.
class RowMachines {
 public:
  /// `tree` includes the overrides common to all rows.
  RowMachines(const SweepRequest& request, ParameterTree tree, ComponentFactory& factory,
              CodeOfRows& code)
      : request_(request), tree_(std::move(tree)), factory_(factory), code_(code) {}

  /// Throws SceneError.
  Simulation make(const std::vector<double>& values) {
    Scene scene = readRow(values);
    if (!keeps_formulas_) {
      Simulation simulation(std::move(scene));
      code_.giveTo(simulation);
      return simulation;
    }
    if (like_ == nullptr) like_ = std::make_unique<Simulation>(scene);
    code_.giveTo(*like_);
    Simulation simulation(std::move(scene), *like_);
    return simulation;
  }

 private:
  /// Runs after which the formulas are read anew, since their graph may grow with every run.
  static constexpr int kUses = 64;

  Scene readRow(const std::vector<double>& values) {
    ParameterTree tree = tree_;
    for (std::size_t i = 0; i < values.size(); ++i) {
      setValue(tree, request_.paths[i], ParameterTree::real(values[i]));
    }
    if (uses_left_ > 0) {
      --uses_left_;
      Scene scene = model_;
      rereadNumbers(tree, nodeNames(), &scene);
      return scene;
    }
    Scene scene = readScene(tree, factory_, nodeNames());
    if (!is_known_) inspect(scene);
    if (keeps_formulas_) {
      model_ = scene;
      uses_left_ = kUses;
      like_.reset();
    }
    return scene;
  }

  void inspect(const Scene& scene) {
    is_known_ = true;
    for (const Law* law : scene.laws()) {
      if (law->callsOpaqueFunction()) return;  // its gradients are checked in each row
    }
    const std::vector<std::string>& paths = request_.paths;
    keeps_formulas_ = std::all_of(paths.begin(), paths.end(), [&](const std::string& path) {
      return isOutsideFormulas(path, scene);
    });
    // One check suffices for all rows.
    setValue(tree_, "verify_derivatives", ParameterTree::boolean(false));
  }

  const SweepRequest& request_;
  ParameterTree tree_;
  ComponentFactory& factory_;
  CodeOfRows& code_;
  bool is_known_ = false;
  bool keeps_formulas_ = false;
  Scene model_;
  /// Simulation of the first row with these formulas.
  std::unique_ptr<Simulation> like_;
  int uses_left_ = 0;
};

SweepRow runRow(const SweepRequest& request, const std::vector<double>& values,
                RowMachines& machines) {
  SweepRow row;
  row.metrics.assign(request.metrics.size(), kNaN);
  try {
    Simulation simulation = machines.make(values);
    simulation.trackEnergy(request.run.columns.energy);
    const RunRows rows = run(simulation, request.run);
    row.reason = simulation.describeStatus();
    if (!row.reason.empty()) return row;
    const std::size_t width = columnNames(simulation, request.run.columns).size();
    for (std::size_t i = 0; i < request.metrics.size(); ++i) {
      row.metrics[i] = calcMetric(request.metrics[i], rows.values, width);
    }
  } catch (const std::bad_alloc&) {
    throw;  // no fault of the row
  } catch (...) {
    row.reason = describeThrown();
  }
  return row;
}

/// The data that the threads of a sweep share; a thread that a plugin blocks may outlive the sweep.
struct Sweep {
  Sweep(SweepRequest its_request, std::vector<std::vector<double>> its_values,
        std::shared_ptr<ComponentFactory> its_factory)
      : request(std::move(its_request)),
        values(std::move(its_values)),
        factory(std::move(its_factory)),
        tree(withOverrides(request.tree, request.overrides)),
        code(request.compiles),
        rows(values.size()) {}

  /// Runs rows until there are none left.
  void work() {
    try {
      const Interruption interruption([this] { return is_cancelled.load(); });
      RowMachines machines(request, tree, *factory, code);
      for (std::size_t i = next++; i < values.size() && !is_cancelled; i = next++) {
        rows[i] = runRow(request, values[i], machines);
      }
    } catch (...) {
      is_cancelled = true;
      const std::lock_guard<std::mutex> lock(mutex);
      if (!error) error = std::current_exception();
    }
    const std::lock_guard<std::mutex> lock(mutex);
    --running;
    one_has_ended.notify_one();
  }

  const SweepRequest request;
  const std::vector<std::vector<double>> values;
  const std::shared_ptr<ComponentFactory> factory;
  const ParameterTree tree;
  CodeOfRows code;
  std::vector<SweepRow> rows;
  std::atomic<std::size_t> next{0};
  std::atomic<bool> is_cancelled{false};
  std::mutex mutex;
  std::condition_variable one_has_ended;
  std::size_t running = 0;
  std::exception_ptr error;  ///< the first one
};

}  // namespace

ParameterTree withOverrides(ParameterTree tree, const Overrides& overrides) {
  applyOwnOverrides(tree);
  for (const auto& [path, value] : overrides) setValue(tree, path, value);
  return tree;
}

RunRows run(Simulation& simulation, const RunRequest& request, Sensitivity* sensitivity) {
  const double begin = simulation.time();
  const double end = begin + request.duration;
  OfflineRun offline(simulation,
                     request.has_times ? SampleTimes::at(request.times)
                                       : SampleTimes::atRate(request.rate, begin, end),
                     resolveCommands(request.commands, simulation.scene(), "commands"), end);
  offline.observe(request.columns.quantities);
  offline.differentiate(sensitivity);
  if (request.until_rest) offline.endAtRest();
  RunRows rows;
  rows.ignored_commands = offline.ignoredCount() + offline.pastCount();
  const RowMaker maker(simulation, request.columns);
  SampleBlock samples;
  samples.samples.reserve(OfflineRun::kBlockSize);
  for (bool more = true; more && !Interruption::isWanted();) {
    more = offline.advanceBlock(kNever, samples);
    const double* quantities = samples.quantities.data();
    for (const Sample& sample : samples.samples) {
      rows.values.resize(rows.values.size() + maker.columnCount());
      maker.write(sample, quantities,
                  rows.values.data() + rows.values.size() - maker.columnCount());
      quantities += maker.quantityCount();
    }
  }
  return rows;
}

double calcMetric(const Metric& metric, const std::vector<double>& rows, std::size_t width) {
  if (rows.empty()) return kNaN;
  if (metric.kind == "final") return rows[rows.size() - width + metric.column];
  if (metric.kind == "mean") return calcMean(rows, width, metric.column);
  if (metric.kind == "integral") return calcIntegral(rows, width, metric.column);
  if (metric.kind == "settling") return calcSettlingTime(rows, width, metric.column, metric.band);
  double extreme = rows[metric.column];
  for (std::size_t i = metric.column; i < rows.size(); i += width) {
    const bool is_beyond = metric.kind == "min" ? rows[i] < extreme : rows[i] > extreme;
    if (is_beyond || std::isnan(rows[i])) extreme = rows[i];
  }
  return extreme;
}

std::vector<SweepRow> runSweep(SweepRequest request, std::vector<std::vector<double>> values,
                               int threads, std::shared_ptr<ComponentFactory> factory) {
  constexpr auto kLook = std::chrono::milliseconds(50);
  constexpr int kMostLooks = 14;  // after an Interruption
  const auto sweep =
      std::make_shared<Sweep>(std::move(request), std::move(values), std::move(factory));
  std::vector<std::thread> pool;
  std::unique_lock<std::mutex> lock(sweep->mutex);
  try {
    const auto wanted = static_cast<std::size_t>(std::max(threads, 1));
    const std::size_t count = std::min(wanted, sweep->values.size());
    pool.reserve(count);
    for (; sweep->running < count; ++sweep->running) pool.emplace_back([sweep] { sweep->work(); });
  } catch (...) {
    // Fewer threads give the same rows.
    if (pool.empty()) sweep->error = std::current_exception();
  }
  int looks = 0;
  while (!sweep->one_has_ended.wait_for(lock, kLook, [&] { return sweep->running == 0; })) {
    lock.unlock();
    if (Interruption::isWanted()) {
      sweep->is_cancelled = true;
      if (++looks == kMostLooks) {
        for (std::thread& thread : pool) thread.detach();
        throw Interrupted();
      }
    }
    lock.lock();
  }
  lock.unlock();
  for (std::thread& thread : pool) thread.join();
  if (sweep->error) std::rethrow_exception(sweep->error);
  return std::move(sweep->rows);
}

}  // namespace variator_sim::python
