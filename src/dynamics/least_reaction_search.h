/// The least of all least reactions: the point of psi = 0 nearest to the free accelerations.
///
/// If psi is nonlinear in epsilon, the distance may have many minima on psi = 0. One found at a
/// distance r bounds the search to the ball of radius r (in the metric J) around the free
/// accelerations f. psi reads only some accelerations other than linearly, n of them: with
///     epsilon = f + E x - F v(x),   |epsilon - f|^2 = |x|^2 + |v(x)|^2,
/// x (n values) moves these and the rest goes along as J has it; v makes zero the rows of psi that
/// the others can make zero, at the least distance and by constant coefficients. The `hard` rows,
/// which they cannot, are to be zero by x alone. So the ball is one of n dimensions, n = 1 in most
/// scenes. It is sampled along rays from its centre, as densely as cubics between the samples fit
/// psi; the minima of the distance of these cubics are starts for descents along psi = 0. A better
/// minimum makes the ball smaller, and the search goes on until another look brings nothing better.
#pragma once

#include <cmath>
#include <cstdint>

#include "dynamics/least_reaction.h"

namespace variator_sim {

/// The accelerations that a motion begins with, where psi is not linear in them and several may be
/// consistent. Allocates nothing, although it does not run in the loop: a command at the first
/// instant calls it again.
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

  /// `scene` has to outlive it.
  explicit LeastReactionSearch(const Scene& scene)
      : S(scene.shaftCount()), constraints_(scene), solver_(constraints_) {}

  /// Finds the accelerations of least reaction: the classical Gauss principle, minimise 1/2 R^T
  /// J^-1 R under psi = 0, at a state whose own are not read. `epsilon` gets the best candidate, or
  /// the free accelerations where there is none.
  Verdict findLeastReaction(const StateView& state, double* epsilon);
  /// Moves given accelerations onto psi = 0 near by. False where that fails.
  bool retract(const StateView& state, double* epsilon);
  /// Finds the point of stationary reaction at `state` by iterating from `epsilon` and the
  /// multipliers (kMaxShafts places) of a point near by. False where that fails.
  bool follow(const StateView& state, double* epsilon, double* multipliers) {
    constraints_.enter(state);
    return solver_.solve(state, 0, epsilon, multipliers);
  }
  /// Writes the multipliers of the reaction at `state`, one per constraint: others may lead the
  /// iteration to another branch. False if C has lost rank.
  bool calcMultipliers(const StateView& state, double* lambda) {
    constraints_.enter(state);
    return constraints_.calcMultipliers(state, lambda);
  }

  /// The best ones, the least reaction first.
  int candidateCount() const { return candidate_count_; }
  const Candidate& candidate(int n) const { return candidates_[n]; }

 private:
  static constexpr int kMostStarts = 48;
  static constexpr int kMostCandidates = 4;
  static constexpr int kMostRays = 768;
  static constexpr int kRays = 96;  ///< in more than one dimension
  /// Samples that one look through the ball may take, and halvings of one part of a ray.
  static constexpr int kMostEvaluations = 40000;
  static constexpr int kMostHalvings = 22;
  /// Points that are nearer to each other than this, relative to accelerations, are one.
  static constexpr double kSame = 1e-6;

  using Matrix = DenseMatrix;
  using Vector = AccelerationConstraints::Vector;

  /// A sample of a ray: the soft rows' v, then the hard ones, and their derivatives by t.
  struct Sample {
    double t;
    Vector v;
    Vector dv;
    bool isFinite() const { return v.allFinite() && dv.allFinite(); }
  };
  struct Start {
    Vector epsilon;
    double value;  ///< |epsilon - f|^2, more where psi is not zero
  };

  int rowCount() const { return constraints_.rowCount(); }
  const Constraint& row(int m) const { return constraints_.row(m); }
  const Vector& free() const { return constraints_.free(); }
  /// Looks for candidates at a state that the constraints were entered at; `first`: accelerations
  /// that satisfy psi = 0, or nullptr.
  Verdict find(const StateView& state, const double* first);
  /// Up to 100 half steps towards the least reaction of the linearised constraints, from `epsilon`.
  void approach(const StateView& given, double* epsilon);
  /// Finds E, F and T.
  void setUp();
  /// The rows of C at a place where all are finite, without the parts in x, made of length 1 by
  /// `length`.
  Matrix calcRowsOutside(const Matrix& rest, Vector* length) const;

  /// The direction of a ray in epsilon, of length 1 in the metric J.
  Vector calcDirection(int ray) const;
  Sample evaluate(const Vector& along, double t);
  /// The cubic through both ends at the part `theta` of [a, b].
  static Sample interpolate(const Sample& a, const Sample& b, double theta);
  /// Looks through the ball, which becomes smaller, until that brings nothing better. False if
  /// there may be a better candidate still; one that most_rays find where these are few.
  bool lookAround(int fewest_rays, int most_rays);
  double calcRadius() const { return std::sqrt(2.0 * candidates_[0].reaction); }
  /// Notes the starts in the ball, halves parts of rays up to `halvings` times, and descends from
  /// the starts. Returns false if psi needs more samples.
  bool lookThrough(double radius, int rays, int halvings);
  /// Notes the starts between two samples, and evaluates psi between them where it is no cubic.
  void lookWithin(const Sample& from, const Sample& to, const Vector& along, int halvings);
  /// Tells whether the cubic through `from` and `to` fits the sample between them; kFar: psi has no
  /// zero there within reach_ of the free accelerations.
  enum class Fit { kFar, kCubic, kOther };
  Fit judge(const Sample& from, const Sample& middle, const Sample& to) const;
  /// Notes the starts on the cubic through two samples: zeros of one hard row, and minima.
  void noteStarts(const Sample& from, const Sample& to, const Vector& along);
  /// Keeps it among the kMostStarts nearest ones, one of each place.
  void noteStart(const Sample& sample, const Vector& along, double penalty);
  /// The same point in a list, and whether it is to stay instead of the new one.
  enum class Twin { kNone, kBetter, kWorse };
  /// Puts `item` into a list that is sorted by `value`, instead of a worse twin; the last one of
  /// too many goes.
  template <class Item, class Compare>
  static void keep(const Item& item, double Item::*value, int most, Item* items, int* count,
                   Compare compare);

  /// |v|^2 in the metric J.
  double measure(const Vector& v) const;
  double squaredDistance(const Vector& epsilon) const;
  /// Squared distances above this are of no interest.
  double hopeful() const;

  /// Along psi = 0 towards the least reaction of the linearised constraints, by steps that lessen
  /// the reaction.
  void descend(Vector epsilon);
  /// Newton's iteration from the end of a descent at the squared distance `value`, and the corners
  /// near by.
  void polish(const StateView& state, const Vector& epsilon, double value);

  /// Puts accelerations with psi = 0 among the candidates.
  void record(const Vector& epsilon, bool is_stationary);
  /// Without a candidate nothing bounds the ball: it grows until there is one.
  void findFirst(int rays);
  /// Returns the distance that rounding of the free accelerations accounts for.
  double calcRoundingDistance() const;
  Verdict conclude(bool is_certain) const;

  const int S;  // shafts
  AccelerationConstraints constraints_;
  LeastReactionSolver solver_;
  StateView state_{};
  int n_ = 0;     // accelerations that psi is not linear in
  int soft_ = 0;  // rows that the others can make zero
  Matrix E_;      // S x n
  Matrix F_;      // S x soft
  Matrix T_;      // (v, hard) = T psi
  int next_ray_ = 0;
  int parts_ = 0;            // of a ray, before they are halved
  int noted_ = 0;            // minima in the last look through the ball
  int evaluations_ = 0;      // samples in it
  bool is_resolved_ = true;  // it had samples enough for psi
  double reach_ = 0.0;       // the distance up to which it looks
  double apart_ = 0.0;       // starts nearer to each other are one
  double negligible_ = 0.0;  // differences of distances
  double smallest_ = 0.0;
  Start starts_[kMostStarts];
  int start_count_ = 0;
  Candidate candidates_[kMostCandidates];
  int candidate_count_ = 0;
};

}  // namespace variator_sim
