/// The least of all least reactions: the point of psi = 0 nearest to the free accelerations.
///
/// If psi is nonlinear in epsilon, the distance may have many minima on psi = 0. One found at a
/// distance r bounds the search to the ball of radius r (in the metric J) around the free
/// accelerations f. psi reads only some accelerations other than linearly, n of them: with
///     epsilon = f + E x - F v(x),   |epsilon - f|^2 = |x|^2 + |v(x)|^2,
/// x (n values) moves these and the rest follows by J; v zeroes the rows of psi that the others can
/// zero, at the least distance and by constant coefficients. The `hard` rows are to be zero by x
/// alone. So the ball has n dimensions, n = 1 in most scenes. It is sampled along rays from its
/// centre; the least samples of each ray are starts for descents along psi = 0. A better minimum
/// shrinks the ball, and the search continues until a finer sampling finds no improvement.
#pragma once

#include <cmath>
#include <cstdint>

#include "dynamics/drivetrain.h"
#include "dynamics/least_reaction.h"

namespace variator_sim {

/// It allocates nothing, although it does not run in the loop: a command at the first instant calls
/// it again.
class LeastReactionSearch {
 public:
  /// Accelerations with psi = 0 and the reaction 1/2 R^T J^-1 R there.
  struct Candidate {
    double epsilon[kMaxShafts];
    double reaction;
    bool is_stationary;
  };
  enum class Verdict {
    kFound,     ///< the first candidate is the minimum
    kTie,       ///< the first two are equally good
    kDoubtful,  ///< a better one than the first may exist
    kNone
  };

  LeastReactionSearch(Drivetrain& drivetrain, LeastReactionSolver& solver)
      : S(drivetrain.shafts()), drivetrain_(drivetrain), solver_(solver) {}

  /// The best candidates, the least reaction first.
  int candidateCount() const { return candidate_count_; }
  const Candidate& candidate(int n) const { return candidates_[n]; }
  void forget() { candidate_count_ = 0; }

  /// Searches for candidates. `torque` is Q - n, `free` J^-1 (Q - n), `first` accelerations that
  /// satisfy psi = 0, or nullptr.
  Verdict find(const StateView& state, const double* torque, const double* free,
               const double* first);

 private:
  static constexpr int kMostStarts = 48;
  static constexpr int kMostCandidates = 4;
  /// Maximum samples of one sweep through the ball.
  static constexpr int kMostEvaluations = 40000;
  /// Parts of a ray per minimum: four subdivisions of each give twelve samples per minimum.
  static constexpr int kPartsPerMinimum = 3;
  /// Points nearer to each other than this, relative to accelerations, count as one.
  static constexpr double kSame = 1e-6;

  using Matrix = DenseMatrix;
  using Vector = Eigen::Matrix<double, Eigen::Dynamic, 1, 0, kMaxShafts, 1>;

  /// A sample of a ray: the soft rows' v, then the hard rows, and their derivatives by t.
  struct Sample {
    double t;
    Vector v;
    Vector dv;
    bool isFinite() const { return v.allFinite() && dv.allFinite(); }
  };
  struct Start {
    Vector epsilon;
    double value;  ///< |epsilon - f|^2, larger where psi is not zero
  };

  int rowCount() const { return static_cast<int>(drivetrain_.accelerationRows().size()); }
  const Constraint& row(int m) const {
    return drivetrain_.constraint(drivetrain_.accelerationRows()[static_cast<std::size_t>(m)]);
  }
  /// Computes E, F and T.
  void setUp();
  /// Returns the rows of C at a point where all are finite, without the parts in x, scaled to
  /// length 1 by `length`.
  Matrix calcRowsOutside(const Matrix& rest, Vector* length) const;

  /// Returns the direction of a ray in epsilon, of length 1 in the metric J.
  Vector calcDirection(int ray) const;
  Sample evaluate(const Vector& along, double t) const;
  /// Evaluates the cubic through both ends at the part `theta` of [a, b].
  static Sample interpolate(const Sample& a, const Sample& b, double theta);
  /// Returns the slope of the function minimised at starts: 1/2 |epsilon - f|^2, or 1/2 |hard|^2.
  double calcSlope(const Sample& sample) const;
  /// Notes the starts in the ball and descends from them.
  void lookThrough(double radius, int rays, int parts);
  /// Notes the starts between two samples: zeros of one hard row, and minima.
  void lookWithin(const Sample& from, const Sample& to, const Vector& along);
  /// Keeps a start among the kMostStarts nearest ones, one per place.
  void noteStart(const Sample& sample, const Vector& along, double penalty);
  /// Tells whether a list has the same point already, and whether it is better than the new one.
  enum class Twin { kNone, kBetter, kWorse };
  /// Inserts `item` into a list sorted by `value`, replacing a worse twin; drops the last one of
  /// too many.
  template <class Item, class Compare>
  static void keep(const Item& item, double Item::*value, int most, Item* items, int* count,
                   Compare compare);

  /// Returns |v|^2 in the metric J.
  double measure(const Vector& v) const;
  double squaredDistance(const Vector& epsilon) const;
  /// Upper bound of squared distances of interest.
  double hopeful() const;

  /// Descends along psi = 0 towards the least reaction of the linearised constraints, by steps that
  /// reduce the reaction.
  void descend(Vector epsilon);
  /// Refines the end of a descent at the squared distance `value` by Newton's iteration, and
  /// examines nearby corners.
  void polish(const StateView& state, const Vector& epsilon, double value);
  /// Computes lambda with C^T lambda nearest to R = J (epsilon - f): A lambda = C (epsilon - f).
  void calcMultipliers(const StateView& state, double* multipliers) const;

  /// Adds accelerations with psi = 0 to the candidates.
  void record(const Vector& epsilon, bool is_stationary);
  /// Grows the ball until it has a first candidate, as nothing else bounds it.
  void findFirst(int rays, int parts);
  /// The rounding error of the free accelerations, below which distances mean nothing.
  double calcRoundingDistance() const;
  Verdict conclude(bool is_certain) const;

  const int S;  // shafts
  Drivetrain& drivetrain_;
  LeastReactionSolver& solver_;
  StateView state_{};
  const double* torque_ = nullptr;
  const double* free_ = nullptr;
  Matrix J_;
  Matrix inverse_;         // of J
  int n_ = 0;              // accelerations that psi is not linear in
  int soft_ = 0;           // rows that the others can make zero
  bool is_cubic_ = false;  // psi, in the accelerations
  Matrix E_;               // S x n
  Matrix F_;               // S x soft
  Matrix T_;               // (v, hard) = T psi
  int next_ray_ = 0;
  int noted_ = 0;       // minima in the last sweep through the ball
  double apart_ = 0.0;  // starts nearer to each other count as one
  double smallest_ = 0.0;
  Start starts_[kMostStarts];
  int start_count_ = 0;
  Candidate candidates_[kMostCandidates];
  int candidate_count_ = 0;
};

}  // namespace variator_sim
