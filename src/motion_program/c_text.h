/// C as text, and the files of src/runtime, which are the same for all scenes.
///
/// `scene_` and `SCENE_` in them stand for the scene's name.
#pragma once

#include <string>
#include <vector>

namespace variator_sim {

/// status.h, scene.h, state.h, series.h, model.h, calls.h
extern const char* const kSceneHeader;
/// operations.h and tables.h, which the scene's formulas call.
extern const char* const kOperations;
extern const char* const kTableFunctions;
/// series_operation.inc, series_resolution.inc, series_ranges.inc
extern const char* const kSeriesCheck;
/// The motion; it calls the scene's formulas.
extern const char* const kMotion;
/// The functions of calls.h.
extern const char* const kInterface;
/// table_data.h; exchange_data.h; exchange.h; commands.h; host.h; host_kernel.h
extern const char* const kTableData;
extern const char* const kExchangeData;
extern const char* const kExchange;
extern const char* const kCommands;
extern const char* const kHost;
extern const char* const kHostKernel;
/// fmu.h, fmu_instance.h, fmu_derivatives.h; fmi2.h, fmi.h; fmi3.h, fmi.h
extern const char* const kFmu;
extern const char* const kFmi2;
extern const char* const kFmi3;
/// player.c
extern const char* const kPlayer;

/// Replaces every `from` by `to`.
void replaceAll(std::string& text, const std::string& from, const std::string& to);
/// Returns `text` with the scene's name in place of `scene_` and `SCENE_`.
std::string withName(std::string text, const std::string& name);
/// Returns `text` for a comment or a string of C, without characters that could end it.
std::string harmless(std::string text);
/// Returns `name` in capitals.
std::string inCapitals(std::string name);

/// Writes a double as C, exactly.
std::string literalOf(double value);
inline std::string literalOf(int value) {
  return std::to_string(value);
}
/// Writes `static const TYPE NAME[] = {..};`, which has one element more if there are none.
std::string arrayOf(const std::string& type, const std::string& name,
                    const std::vector<std::string>& values);
template <class Value>
std::string arrayOf(const std::string& type, const std::string& name,
                    const std::vector<Value>& values) {
  std::vector<std::string> words;
  words.reserve(values.size());
  for (const Value value : values) words.push_back(literalOf(value));
  return arrayOf(type, name, words);
}

}  // namespace variator_sim
