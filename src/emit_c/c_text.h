/// The parts of an emitted program that are the same for every scene, as C99.
///
/// `scene_` and `SCENE_` in them stand for the scene's own name.
#pragma once

#include <set>
#include <string>

namespace variator_sim {

/// Functions on power series: coefficient n of a row from those of others. Those that are in
/// `used`, with what they need, in an order that compiles.
std::string writeSeriesFunctions(std::set<std::string> used);

/// What a header declares below the sizes of the scene.
extern const char* const kHeaderTypes;
extern const char* const kHeaderFunctions;
/// Commanded inputs: closed forms between two events.
extern const char* const kInputCode;
/// J, C and the matrix [J -C^T; C 0] that everything is solved with.
extern const char* const kMatrixCode;
/// Whether all formulas are what their series say.
extern const char* const kResolutionCode;
/// The motion as series, order by order.
extern const char* const kSeriesCode;
/// Moving a state onto the constraints.
extern const char* const kProjectionCode;
/// Where a polynomial first changes its sign, and which branch ends there.
extern const char* const kEdgeCode;
/// What a jump of a torque or an input does to the accelerations.
extern const char* const kJumpCode;
extern const char* const kPathCode;
/// One part of a step after the other.
extern const char* const kStepCode;
/// What a controller calls.
extern const char* const kInterfaceCode;
/// main.c
extern const char* const kMainCode;

/// Puts `to` in the place of every `from`.
void replaceAll(std::string& text, const std::string& from, const std::string& to);
/// `text` with the scene's name in the place of `scene_` and `SCENE_`.
std::string withName(std::string text, const std::string& name);
/// `text` for a comment or a string of C, which nothing in it can end.
std::string harmless(std::string text);
/// `name` in capitals.
std::string inCapitals(std::string name);

}  // namespace variator_sim
