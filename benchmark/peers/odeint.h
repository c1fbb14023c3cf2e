/// Boost's Odeint and the uBLAS types of its implicit stepper.
#pragma once

#include <boost/numeric/odeint.hpp>
#include <boost/numeric/ublas/matrix.hpp>
#include <boost/numeric/ublas/vector.hpp>

// Odeint copies its steppers with arrays that have no values yet; inlined, that is warned of where
// it is used.
#pragma GCC diagnostic ignored "-Wuninitialized"
#pragma GCC diagnostic ignored "-Wmaybe-uninitialized"

namespace variator_sim::benchmark {

namespace odeint = boost::numeric::odeint;
namespace ublas = boost::numeric::ublas;

}  // namespace variator_sim::benchmark
