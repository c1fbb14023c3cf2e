// The text of src/runtime: its series against the functions themselves, its roots against those
// that polynomials are made from, and a scene by hand.
#include <gtest/gtest.h>
#include <math.h>

#include <functional>
#include <vector>

enum { VS_STRIDE = 24 };
#include "runtime/operations.h"
//
#include "runtime/roots.h"
//
#define SCENE_REAL double
#include "runtime/table_data.h"
//
#include "runtime/tables.h"

extern "C" {
#include "runtime/scene_sizes.h"
//
#include "runtime/status.h"
//
#include "runtime/scene.h"
//
#include "runtime/state.h"
//
#include "runtime/series.h"
//
#include "runtime/model.h"
//
#include "runtime/calls.h"
}

namespace {

constexpr int kOrder = 18;
constexpr double kTime = 0.1;

/// The rows of one function; x is a polynomial of time.
struct Rows {
  vs_row x = {0.6, 0.7, -0.4, 0.3};
  vs_row other = {1.3, -0.5, 0.2, 0.1};
  vs_row rate = {};
  vs_row other_rate = {};
  vs_row y = {};
  vs_row z = {};
  vs_row w = {};
  double mode = 0.0;
};

using Step = std::function<void(Rows&, int)>;
using Function = std::function<double(double, double)>;

void expectSeries(const Step& step, const Function& function) {
  Rows rows;
  for (int n = 0; n <= kOrder; ++n) {
    vs_differentiate(rows.rate, rows.x, n);
    vs_differentiate(rows.other_rate, rows.other, n);
    step(rows, n);
  }
  for (const double t : {0.0, kTime, -kTime}) {
    const double expected =
        function(vs_evaluate(rows.x, kOrder, t), vs_evaluate(rows.other, kOrder, t));
    EXPECT_NEAR(vs_evaluate(rows.y, kOrder, t), expected, 2e-14 * (1.0 + std::abs(expected)));
  }
}

TEST(Runtime, ProductsAndQuotients) {
  expectSeries([](Rows& r, int n) { vs_multiply(r.y, r.x, r.other, n); },
               [](double x, double other) { return x * other; });
  expectSeries([](Rows& r, int n) { vs_square(r.y, r.x, n); },
               [](double x, double) { return x * x; });
  expectSeries([](Rows& r, int n) { vs_divide(r.y, r.x, r.other, n); },
               [](double x, double other) { return x / other; });
  expectSeries([](Rows& r, int n) { vs_square_root(r.y, r.other, n); },
               [](double, double other) { return sqrt(other); });
  expectSeries([](Rows& r, int n) { vs_power(r.y, r.other, r.other_rate, kOrder, 1.7, n); },
               [](double, double other) { return pow(other, 1.7); });
}

TEST(Runtime, FunctionsWithEquationsOfTheirOwn) {
  expectSeries([](Rows& r, int n) { vs_exponential(r.y, r.x, r.rate, kOrder, n); },
               [](double x, double) { return exp(x); });
  expectSeries([](Rows& r, int n) { vs_sine_cosine(r.y, r.z, r.x, r.rate, kOrder, n); },
               [](double x, double) { return sin(x); });
  expectSeries([](Rows& r, int n) { vs_sine_cosine(r.z, r.y, r.x, r.rate, kOrder, n); },
               [](double x, double) { return cos(x); });
  expectSeries([](Rows& r, int n) { vs_sinh_cosh(r.y, r.z, r.x, r.rate, kOrder, n); },
               [](double x, double) { return sinh(x); });
  expectSeries([](Rows& r, int n) { vs_tangent(r.y, r.z, r.x, r.rate, kOrder, n); },
               [](double x, double) { return tan(x); });
  expectSeries([](Rows& r, int n) { vs_tangent_hyperbolic(r.y, r.z, r.x, r.rate, kOrder, n); },
               [](double x, double) { return tanh(x); });
}

TEST(Runtime, IntegralsOfQuotients) {
  expectSeries(
      [](Rows& r, int n) { vs_integrate_quotient(r.y, r.z, log(r.x[0]), r.rate, r.x, 1.0, n); },
      [](double x, double) { return log(x); });
  expectSeries(
      [](Rows& r, int n) {
        vs_square(r.w, r.x, n);
        r.w[n] += n == 0 ? 1.0 : 0.0;
        vs_integrate_quotient(r.y, r.z, atan(r.x[0]), r.rate, r.w, 1.0, n);
      },
      [](double x, double) { return atan(x); });
}

TEST(Runtime, ModesGoInTheDirectionOfMotion) {
  expectSeries([](Rows& r, int n) { vs_choose(r.y, r.x, r.other, r.x, r.other, &r.mode, n); },
               [](double x, double other) { return std::min(x, other); });
  Rows rows;
  rows.x[0] = rows.x[1] = 0.0;  // x = -0.4 t^2 + ..
  for (int n = 0; n <= kOrder; ++n) vs_absolute(rows.y, rows.x, &rows.mode, n);
  EXPECT_EQ(rows.y[2], 0.4);
}

TEST(Runtime, TablesOfOneVariable) {
  // t^3 and, from 1 on, 1 + 3 (t - 1) + 3 (t - 1)^2 + (t - 1)^3, its continuation
  static const double points[] = {0.0, 1.0};
  static const double pieces[] = {0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0,
                                  1.0, 0.0, 0.0, 1.0, 3.0, 3.0, 1.0, 0.0, 0.0};
  static const vs_table table = {2, points, pieces};
  vs_row h[3] = {};
  double mode[3], piece[6];
  expectSeries([&](Rows& r, int n) { vs_look_up(r.y, h, r.x, &table, mode, piece, n); },
               [](double x, double) { return x * x * x; });
  expectSeries([&](Rows& r, int n) { vs_look_up(r.y, h, r.other, &table, mode, piece, n); },
               [](double, double x) { return x * x * x; });
}

/// The polynomial with these roots.
std::vector<double> polynomialOf(const std::vector<double>& roots) {
  std::vector<double> c = {1.0};
  for (const double root : roots) {
    c.push_back(0.0);
    for (std::size_t n = c.size() - 1; n > 0; --n) c[n] = c[n - 1] - root * c[n];
    c[0] *= -root;
  }
  return c;
}

TEST(Runtime, FirstRoots) {
  struct Case {
    std::vector<double> roots;
    double end, first;
  };
  for (const Case& it : {Case{{0.3}, 1.0, 0.3}, Case{{0.7, 0.3, 2.0}, 1.0, 0.3},
                         Case{{-0.2, 0.9, 0.95, 0.97}, 1.0, 0.9},
                         Case{{0.5, 0.5 + 1e-6, 0.8}, 1.0, 0.5}, Case{{1.5, -1.0}, 1.0, 2.0},
                         Case{{0.0, 0.4}, 1.0, 0.4}, Case{{0.1, 0.2, 0.3, 0.4, 0.5}, 1.0, 0.1}}) {
    const std::vector<double> c = polynomialOf(it.roots);
    const double found = vs_first_root(c.data(), static_cast<int>(c.size()) - 1, it.end);
    EXPECT_NEAR(found, it.first, 1e-9);
  }
  const double none[] = {0.25 + 1e-12, -1.0, 1.0};  // (x - 0.5)^2 + 1e-12
  EXPECT_GT(vs_first_root(none, 2, 1.0), 1.0);
}

TEST(Runtime, ASwingKeepsItsEnergy) {
  scene_model model;
  scene_sample sample;
  scene_init(&model);
  for (int k = 1; k <= 20; ++k) {
    ASSERT_EQ(scene_advance_to(&model, 0.5 * k), SCENE_OK);
    ASSERT_EQ(scene_read(&model, &sample), SCENE_OK);
    const double w = sample.velocity[0];
    EXPECT_NEAR(0.5 * w * w - cos(sample.angle[0]), -cos(1.0), 1e-7);  // (the follower has 1e-9)
    EXPECT_NEAR(sample.velocity[1], 2.0 * w, 1e-10);
    EXPECT_NEAR(sample.residual[0], 0.0, 1e-12);
  }
  EXPECT_EQ(model.rejections, 0);
  EXPECT_LT(model.steps, 60);
}

}  // namespace
