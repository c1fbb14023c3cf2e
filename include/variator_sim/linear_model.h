/// Linear models of a motion at one instant, from the exact derivatives of its formulas.
#pragma once

#include <Eigen/Core>
#include <complex>
#include <string>
#include <vector>

#include "variator_sim/operating_point.h"

namespace variator_sim {

enum class LinearForm {
  kMinimal,  ///< coordinates on the manifold that the motion keeps to (psi = 0)
  kFull      ///< all of (phi, omega, epsilon), or (phi, omega), as the principle integrates them
};

/// x' = A x + B u,  y = C x + D u, in deviations from the operating point. doc/linear_models.md
/// explains the states.
struct LinearModel {
  std::vector<std::string> states;   ///< "drive/velocity", "inputs/throttle" (of a lag)
  std::vector<std::string> inputs;   ///< the commands, by the inputs' names
  std::vector<std::string> outputs;  ///< as columns of `simulate` are named
  Eigen::MatrixXd A;
  Eigen::MatrixXd B;
  Eigen::MatrixXd C;
  Eigen::MatrixXd D;
  Eigen::VectorXd x;       ///< the states there
  Eigen::VectorXd u;       ///< the commands there
  Eigen::VectorXd y;       ///< the outputs there
  Eigen::VectorXd x_rate;  ///< x' there, which the deviations leave out
  double time = 0.0;       ///< s
  /// Remarks on the numbers, a sentence each.
  std::vector<std::string> notes;
};

/// Returns the model of `scene` at `point`, whose accelerations have to satisfy the constraints.
/// Throws SceneError off the constraints, where C has lost rank, and in a corner of psi.
LinearModel linearize(const Scene& scene, const OperatingPoint& point,
                      LinearForm form = LinearForm::kMinimal);

/// Returns the eigenvalues of A, 1/s, the slowest first; those that are 0 to rounding are exactly
/// 0. `zero_index`, unless null, receives the size of the largest Jordan block of 0: the length of
/// the longest chain of integrators.
std::vector<std::complex<double>> calcEigenvalues(const LinearModel& model,
                                                  int* zero_index = nullptr);

}  // namespace variator_sim
