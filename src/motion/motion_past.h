/// The pasts of a scene's delayed formulas: memory for the steps of a MotionProgram.
#pragma once

#include <algorithm>
#include <memory>
#include <vector>

#include "motion_program/motion_steps.h"

namespace variator_sim {

class MotionPast {
 public:
  /// The most pieces that one formula's past may have, of about 200 bytes each.
  static constexpr int kMostPieces = 16384;
  /// Doubles of a piece ahead of its coefficients (runtime/inputs.h).
  static constexpr int kHead = 5;

  /// The past of one formula: of each piece its start and the rest of it, its length and unit, s,
  /// the last order, and the coefficients.
  using Pieces = std::vector<std::vector<double>>;

  explicit MotionPast(const MotionProgram& program)
      : program_(program), past_(static_cast<std::size_t>(program.DELAYS)) {
    const int stride = kHead + program.SCENE_STRIDE;
    for (vs_past& it : past_) {
      // (Pages that are never written take no memory.)
      memory_.emplace_back(new double[static_cast<std::size_t>(stride) * kMostPieces]);
      it = {memory_.back().get(), stride, kMostPieces, 0, 0, 0};
    }
  }

  vs_past* data() { return past_.data(); }
  /// Returns the index of a formula whose past has had no room left, -1 if there is none.
  int findFull() const {
    const auto full =
        std::find_if(past_.begin(), past_.end(), [](const vs_past& it) { return it.is_full != 0; });
    return full == past_.end() ? -1 : static_cast<int>(full - past_.begin());
  }

  std::vector<Pieces> save() const {
    std::vector<Pieces> made;
    for (const vs_past& it : past_) {
      made.emplace_back();
      for (int n = 0; n < it.count; ++n) {
        const double* const piece = it.pieces + it.stride * ((it.first + n) % it.capacity);
        made.back().emplace_back(piece, piece + kHead + 1 + static_cast<int>(piece[kHead - 1]));
      }
    }
    return made;
  }
  /// Returns false where the pieces are those of another program.
  bool restore(const std::vector<Pieces>& from) {
    if (from.size() != past_.size()) return false;
    for (std::size_t d = 0; d < from.size(); ++d) {
      vs_past& it = past_[d];
      if (from[d].empty() || from[d].size() > kMostPieces) return false;
      it.first = it.count = it.is_full = 0;
      for (const std::vector<double>& piece : from[d]) {
        const auto last = static_cast<double>(piece.size()) - kHead - 1;
        if (last < 0 || last > program_.SCENE_ORDER || piece[kHead - 1] != last) return false;
        if (!(piece[2] > 0.0) || !(piece[3] > 0.0)) return false;
        std::copy(piece.begin(), piece.end(), it.pieces + it.stride * it.count++);
      }
    }
    return true;
  }

 private:
  const MotionProgram& program_;
  std::vector<vs_past> past_;
  std::vector<std::unique_ptr<double[]>> memory_;
};

}  // namespace variator_sim
