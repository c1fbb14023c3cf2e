/// The parts of an emitted program that are common to all scenes: the files of src/runtime.
///
/// `scene_` and `SCENE_` in them stand for the scene's name.
#pragma once

#include <string>

namespace variator_sim {

/// scene.h
extern const char* const kSceneHeader;
/// operations.h and tables.h, which the scene's formulas call.
extern const char* const kSeriesFunctions;
/// The motion, and the functions of scene.h; it calls the scene's formulas.
extern const char* const kMotion;
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

}  // namespace variator_sim
