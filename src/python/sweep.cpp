#include "python/sweep.h"

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cmath>
#include <condition_variable>
#include <limits>
#include <mutex>
#include <thread>

#include "variator_sim/errors.h"

namespace variator_sim::python {
namespace {

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

/// Lets several threads make components: plugins are loaded by one at a time.
class LockedFactory : public ComponentFactory {
 public:
  explicit LockedFactory(ComponentFactory& factory) : factory_(factory) {}
  ConstraintPtr createConstraint(const std::string& type) override {
    const std::lock_guard<std::mutex> lock(mutex_);
    return factory_.createConstraint(type);
  }
  TorquePtr createTorque(const std::string& type) override {
    const std::lock_guard<std::mutex> lock(mutex_);
    return factory_.createTorque(type);
  }
  std::vector<std::string> constraintTypes() override {
    const std::lock_guard<std::mutex> lock(mutex_);
    return factory_.constraintTypes();
  }
  std::vector<std::string> torqueTypes() override {
    const std::lock_guard<std::mutex> lock(mutex_);
    return factory_.torqueTypes();
  }
  std::shared_ptr<const void> libraries() override {
    const std::lock_guard<std::mutex> lock(mutex_);
    return factory_.libraries();
  }

 private:
  ComponentFactory& factory_;
  std::mutex mutex_;
};

double calcSettlingTime(const std::vector<double>& rows, std::size_t width, std::size_t column,
                        double band) {
  const std::size_t count = rows.size() / width;
  const double last = rows[(count - 1) * width + column];
  const double allowed = band * std::abs(last - rows[column]);
  std::size_t settled = count - 1;
  while (settled > 0 && std::abs(rows[(settled - 1) * width + column] - last) <= allowed) --settled;
  return rows[settled * width] - rows[0];
}

double calcMean(const std::vector<double>& rows, std::size_t width, std::size_t column) {
  double integral = 0.0;
  for (std::size_t i = width; i < rows.size(); i += width) {
    integral += 0.5 * (rows[i + column] + rows[i - width + column]) * (rows[i] - rows[i - width]);
  }
  const double span = rows[rows.size() - width] - rows[0];
  return span > 0.0 ? integral / span : rows[column];
}

SweepRow runRow(const SweepRequest& request, const std::vector<double>& values,
                ComponentFactory& factory, const KeepOn& keep_on) {
  SweepRow row;
  row.metrics.assign(request.metrics.size(), kNaN);
  try {
    Overrides overrides = request.overrides;
    for (std::size_t i = 0; i < values.size(); ++i) {
      overrides.emplace_back(request.paths[i], ParameterTree::real(values[i]));
    }
    Session session(makeScene(request.tree, overrides, factory));
    session.simulation().trackEnergy(request.run.columns.energy);
    const RunRows rows = session.run(request.run, keep_on);
    row.reason = session.simulation().describeStatus();
    if (!row.reason.empty()) return row;
    const std::size_t width = columnNames(session.simulation(), request.run.columns).size();
    for (std::size_t i = 0; i < request.metrics.size(); ++i) {
      row.metrics[i] = calcMetric(request.metrics[i], rows.values, width);
    }
  } catch (const std::exception& error) {
    row.reason = error.what();
  }
  return row;
}

}  // namespace

double calcMetric(const Metric& metric, const std::vector<double>& rows, std::size_t column_count) {
  if (rows.empty()) return kNaN;
  const std::size_t width = column_count;
  switch (metric.kind) {
    case MetricKind::kFinal:
      return rows[rows.size() - width + metric.column];
    case MetricKind::kMean:
      return calcMean(rows, width, metric.column);
    case MetricKind::kSettlingTime:
      return calcSettlingTime(rows, width, metric.column, metric.band);
    case MetricKind::kMinimum:
    case MetricKind::kMaximum:
      break;
  }
  double extreme = rows[metric.column];
  for (std::size_t i = metric.column; i < rows.size(); i += width) {
    const bool is_beyond =
        metric.kind == MetricKind::kMinimum ? rows[i] < extreme : rows[i] > extreme;
    if (is_beyond || std::isnan(rows[i])) extreme = rows[i];
  }
  return extreme;
}

std::vector<SweepRow> runSweep(const SweepRequest& request,
                               const std::vector<std::vector<double>>& values, int threads,
                               ComponentFactory& factory, const KeepOn& keep_on) {
  LockedFactory locked(factory);
  std::vector<SweepRow> rows(values.size());
  std::atomic<std::size_t> next{0};
  std::atomic<bool> is_cancelled{false};
  std::mutex mutex;
  std::condition_variable one_has_ended;
  std::size_t running = std::min(static_cast<std::size_t>(std::max(threads, 1)), values.size());
  const auto work = [&] {
    for (std::size_t i = next++; i < values.size() && !is_cancelled; i = next++) {
      rows[i] = runRow(request, values[i], locked, [&] { return !is_cancelled; });
    }
    const std::lock_guard<std::mutex> lock(mutex);
    --running;
    one_has_ended.notify_one();
  };
  std::vector<std::thread> pool;
  for (std::size_t i = running; i > 0; --i) pool.emplace_back(work);
  {
    std::unique_lock<std::mutex> lock(mutex);
    while (!one_has_ended.wait_for(lock, std::chrono::milliseconds(50),
                                   [&] { return running == 0; })) {
      lock.unlock();
      if (!is_cancelled && !keep_on()) is_cancelled = true;
      lock.lock();
    }
  }
  for (std::thread& thread : pool) thread.join();
  return rows;
}

}  // namespace variator_sim::python
