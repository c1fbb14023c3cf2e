/* Power series of a table's piece from the state on, of degree 5 at most, from order 1 on: for
 * programs whose host cuts out the piece (operations.h goes before). */

/* h_i = (x - x_0)^i = (x - x_0) h_{i-1}, i = 2 .. degree; h: the rows from i = 2 on */
VS_INLINE void vs_raise(vs_row* h, const Real* x, int degree, int n) {
  const Real* before = x;
  int i;
  VS_UNROLL
  for (i = 2; i <= degree && i <= n; ++i) {
    h[i - 2][n] = vs_total(x, before, n, 1, n - i + 1);
    before = h[i - 2];
  }
}

/* sum_{0<i<=degree} a_i (x - x_0)^i */
VS_INLINE Real vs_sum_of_piece(vs_row* h, const Real* x, const Real* a, int stride, int degree,
                               int n) {
  Real sum = a[stride] * x[n];
  int i;
  VS_UNROLL
  for (i = 2; i <= degree && i <= n; ++i) sum = vs_fuse(a[stride * i], h[i - 2][n], sum);
  return sum;
}

/* y = sum_i a_i (x - x_0)^i; h: rows of powers */
VS_INLINE void vs_follow(Real* y, vs_row* h, const Real* x, const Real* a, int degree, int n) {
  vs_raise(h, x, degree, n);
  y[n] = vs_sum_of_piece(h, x, a, 6, degree, n);
}

/* z = sum_i (x - x_0)^i q_i,  q_i = sum_j a_ij (y - y_0)^j
 * h: rows of powers of y - y_0, then q_1 .. , then powers of x - x_0 */
VS_INLINE void vs_follow_two(Real* z, vs_row* h, const Real* x, const Real* y, const Real* a,
                             int degree_x, int degree_y, int n) {
  vs_row* const q = h + (degree_y > 1 ? degree_y - 1 : 0);
  vs_row* const powers = q + degree_x;
  Real sum;
  int i;
  vs_raise(powers, x, degree_x, n);
  vs_raise(h, y, degree_y, n);
  sum = vs_sum_of_piece(h, y, a, 1, degree_y, n);
  VS_UNROLL
  for (i = 1; i <= degree_x; ++i) {
    q[i - 1][n] = vs_sum_of_piece(h, y, a + 6 * i, 1, degree_y, n);
    if (n >= i) sum += vs_total(i == 1 ? x : powers[i - 2], q[i - 1], n, i, n);
  }
  z[n] = sum;
}

/* q_1 .. of orders 0 to n - 1, of a piece that is entered at order n */
VS_INLINE void vs_enter(vs_row* h, const Real* y, const Real* a, int degree_x, int degree_y,
                        int n) {
  vs_row* const q = h + (degree_y > 1 ? degree_y - 1 : 0);
  int i, k;
  for (i = 1; i <= degree_x; ++i) {
    q[i - 1][0] = a[6 * i];
    for (k = 1; k < n; ++k) q[i - 1][k] = vs_sum_of_piece(h, y, a + 6 * i, 1, degree_y, k);
  }
}
