/// The least of all least reactions: the point of psi = 0 nearest to the free accelerations.
///
/// If psi is nonlinear in epsilon, the distance may have many minima on psi = 0. One found at a
/// distance r bounds the search to the ball of radius r (in the metric J) around the free
/// accelerations f. psi reads only some accelerations other than linearly, n of them: with
///     epsilon = f + E x - F v(x),   |epsilon - f|^2 = |x|^2 + |v(x)|^2,
/// x (n values) moves these and the rest goes along as J has it; v makes zero what of psi = 0 the
/// others can make zero, at the least distance and by constant coefficients. What they cannot, the
/// `hard` rest, is to be zero by x alone. So the ball is one of n dimensions, n = 1 in most scenes.
/// It is looked through along rays, by steps as short as psi asks for there, or, where psi is a
/// cubic of the accelerations, by the one cubic that the ray's ends tell; a cubic of two of them by
/// boxes, which leave nothing out. The least ones found are starts for descents along psi = 0. A
/// better minimum makes the ball smaller, and it is looked through again until nothing better
/// comes.
#pragma once

#include <cmath>
#include <cstdint>

#include "dynamics/drivetrain.h"
#include "dynamics/least_reaction.h"

namespace variator_sim {

/// Not for the running loop, but free of allocation all the same: a command at the first instant
/// calls it anew.
class LeastReactionSearch {
 public:
  /// Accelerations with psi = 0 and the reaction 1/2 R^T J^-1 R there.
  struct Candidate {
    double epsilon[kMaxShafts];
    double reaction;
    bool is_stationary;
  };
  enum class Verdict {
    kFound,     ///< the first candidate is the least
    kTie,       ///< the first two are equally good
    kDoubtful,  ///< there may be a better one than the first
    kNone
  };

  LeastReactionSearch(Drivetrain& drivetrain, LeastReactionSolver& solver)
      : S(drivetrain.shafts()), drivetrain_(drivetrain), solver_(solver) {}

  /// The best ones, the least reaction first.
  int candidateCount() const { return candidate_count_; }
  const Candidate& candidate(int n) const { return candidates_[n]; }
  void forget() { candidate_count_ = 0; }
  /// Adds accelerations that satisfy psi = 0.
  void add(const double* epsilon, const double* free);

  /// Looks for better ones than those added. `torque` is Q - n, `free` J^-1 (Q - n).
  Verdict find(const StateView& state, const double* torque, const double* free);

 private:
  static constexpr int kFewestRays = 96;
  static constexpr int kMostRays = 768;
  static constexpr int kMostRounds = 14;
  static constexpr int kMostStarts = 48;
  static constexpr int kMostCandidates = 4;
  static constexpr int kDeepest = 22;
  /// Evaluations of psi that one look through the ball may take.
  static constexpr int kMostEvaluations = 40000;

  using Matrix = DenseMatrix;
  using Vector = DenseVector;

  /// psi on a ray: the soft part v, then the hard one, and their derivatives by t.
  struct Point {
    double t = 0.0;
    double v[kMaxRows] = {};
    double dv[kMaxRows] = {};
    bool is_finite = false;
  };
  struct Start {
    double epsilon[kMaxShafts];
    double value;
  };

  int rowCount() const { return static_cast<int>(drivetrain_.accelerationRows().size()); }
  const Constraint& row(int m) const {
    return drivetrain_.constraint(drivetrain_.accelerationRows()[static_cast<std::size_t>(m)]);
  }
  double radius() const {
    return candidate_count_ > 0 ? std::sqrt(2.0 * candidates_[0].reaction) : radius_;
  }

  // --- E, F, and what makes v of psi -----------------------------------------------------------
  bool setUp();
  Matrix makeBasis(const int* which, const Matrix& inverse);
  Matrix calcRowsOutside(const Matrix& inverse, const Matrix& rest);
  void separateSoftRows(Matrix C, const Matrix& rest);

  // --- along rays ------------------------------------------------------------------------------
  /// The direction of the next ray, of length 1.
  void nextDirection();
  /// Pseudo-random numbers, the same ones in every search.
  double nextUniform();
  double nextNormal();

  void evaluate(double t, Point* point);
  /// Squared distance |epsilon - f|^2 of what the ray's point makes, and its derivative by t.
  double distance(const Point& p, double* slope) const;
  double hardSquare(const Point& p, double* slope) const;

  /// Notes the starts in the ball, along so many rays. False when psi varies too fast for it.
  bool lookThrough(int rays, bool is_coarse);

  // --- by boxes, where n = 2 and psi is a cubic ------------------------------------------------
  struct Cubic;
  /// Notes the starts in the ball, all of them. False where psi is not finite.
  bool lookThroughPlane();
  /// Fits the cubic of every row, the plane in units of `reach`.
  bool fitCubics(double reach, Cubic* cubics);
  /// Rays go to (x, y) of the plane.
  void aimAt(double x, double y);

  /// Cubic through both ends at the part `theta` of [a, b].
  void interpolate(const Point& a, const Point& b, double theta, Point* p) const;

  void scan(const Point& a, const Point& b, int depth);
  /// The same of a whole ray, along which psi is a cubic. False where that is not finite.
  bool scanCubic(double reach, int parts, bool is_first);

  /// Notes minima of the distance (or, with a hard part, where that is zero or least) in [a, b].
  void noteWithin(const Point& a, const Point& b);

  /// Keeps the point a ray leads to among the kMostStarts nearest ones, one of each place.
  void noteStart(const Point& point, double penalty);
  double minimaPerRay() const { return static_cast<double>(noted_) / looked_rays_; }

  /// Within `apart` of each other in the metric J.
  bool areNear(const double* a, const double* b, double apart) const;
  /// |v|^2 in the metric J.
  double measure(const double* v) const;

  // --- descents --------------------------------------------------------------------------------
  void descendAll();

  double squaredDistance(const double* epsilon) const;

  /// Squared distances above this are of no interest.
  double hopeful() const;

  /// Along psi = 0 towards the least reaction of the linearised constraints, by steps that lessen
  /// the reaction; then Newton's iteration, and the corners near by.
  void descend(const double* start);

  /// lambda with C^T lambda nearest to R = J (epsilon - f): A lambda = C (epsilon - f).
  void calcMultipliers(const StateView& state, double* multipliers) const;

  /// Puts accelerations with psi = 0 among the candidates.
  void record(const double* epsilon, bool is_stationary);

  /// Without a candidate nothing bounds the ball: it grows until there is one.
  void findFirst();

  /// Returns the distance that rounding of the free accelerations accounts for.
  double calcRoundingDistance() const;
  Verdict conclude(bool is_certain) const;

  /// Points that are nearer to each other than this, relative to accelerations, are one.
  static constexpr double kSame = 1e-6;
  /// Half a box of which a start is made, in radii: less than what makes two starts one.
  static constexpr int kPlaneDepth = 7;
  static constexpr double kPlaneLeaf = 1.0 / 128.0;
  /// The effect of rounding on a cubic, relative to the sum of its coefficients.
  static constexpr double kCubicNoise = 1e-9;

  const int S;  // shafts
  Drivetrain& drivetrain_;
  LeastReactionSolver& solver_;
  StateView state_{};
  const double* torque_ = nullptr;
  const double* free_ = nullptr;
  int n_ = 0;                      // accelerations that psi is not linear in
  int soft_ = 0;                   // rows that the others can make zero
  bool is_cubic_ = false;          // psi, in the accelerations
  Matrix E_;                       // S x n
  Matrix F_;                       // S x k
  Matrix T_;                       // (v, hard) = T psi
  double along_[kMaxShafts] = {};  // the ray in epsilon
  std::uint64_t random_ = 20;
  int ray_ = 0;
  int looked_rays_ = 1;
  int noted_ = 0;
  int evaluations_ = 0;
  int limit_ = 0;
  bool is_coarse_ = false;
  bool is_resolved_ = true;
  double allowed_ = 0.0;
  double negligible_ = 0.0;
  double radius_ = 0.0;
  double smallest_ = 0.0;
  Start starts_[kMostStarts];
  int start_count_ = 0;
  Candidate candidates_[kMostCandidates];
  int candidate_count_ = 0;
};

}  // namespace variator_sim
