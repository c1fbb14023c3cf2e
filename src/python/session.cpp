#include "python/session.h"

#include <limits>

#include "variator_sim/interruption.h"
#include "variator_sim/io/override_text.h"
#include "variator_sim/overrides.h"

namespace variator_sim::python {

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
  constexpr double kNoEnd = std::numeric_limits<double>::infinity();
  for (bool more = true; more && !Interruption::isWanted();) {
    more = offline.advanceBlock(kNoEnd, samples);
    const double* quantities = samples.quantities.data();
    for (const Sample& sample : samples.samples) {
      rows.values.resize(rows.values.size() + maker.columnCount());
      maker.write(sample, quantities,
                  rows.values.data() + rows.values.size() - maker.columnCount());
      quantities += maker.quantityCount();
    }
  }
  rows.events = offline.events();
  return rows;
}

}  // namespace variator_sim::python
