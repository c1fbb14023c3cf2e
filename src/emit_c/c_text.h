/// The parts of an emitted program common to all scenes, as C99.
///
/// They contain the placeholders `scene_` and `SCENE_` for the scene's name.
#pragma once

#include <set>
#include <string>

namespace variator_sim {

/// Writes the functions on power series (coefficient n of a row from those of others) that are in
/// `used`, with the functions they need, in an order that compiles.
std::string writeSeriesFunctions(std::set<std::string> used);

/// The declarations of a header below the sizes of the scene.
extern const char* const kHeaderTypes;
extern const char* const kHeaderFunctions;
/// Commanded inputs: closed forms between two events.
extern const char* const kInputCode;
/// J, C and the matrix [J -C^T; C 0] of all linear systems.
extern const char* const kMatrixCode;
/// The check that series resolve all formulas.
extern const char* const kResolutionCode;
/// The motion as series, order by order.
extern const char* const kSeriesCode;
/// The projection of a state onto the constraints.
extern const char* const kProjectionCode;
/// Event localization: the first sign change of a polynomial, and the mode that ends there.
extern const char* const kEdgeCode;
/// The effect of a jump of a torque or an input on the accelerations.
extern const char* const kJumpCode;
extern const char* const kPathCode;
/// The parts of a step, in order.
extern const char* const kStepCode;
/// The functions for a controller.
extern const char* const kInterfaceCode;
/// main.c
extern const char* const kMainCode;

/// Replaces every `from` by `to`.
void replaceAll(std::string& text, const std::string& from, const std::string& to);
/// Returns `text` with the scene's name in place of `scene_` and `SCENE_`.
std::string withName(std::string text, const std::string& name);
/// Returns `text` for a comment or a string of C, without characters that could end it.
std::string harmless(std::string text);
/// Returns `name` in capitals.
std::string inCapitals(std::string name);

}  // namespace variator_sim
