/* Power series of tables: piecewise polynomials of degree 5 of one variable or two (operations.h
 * and table_data.h go before). */

/* The number of ascending points that are not above x; of NaN all. */
VS_INLINE int vs_count_below(const Real* points, int count, double x) {
  int low = 0, high = count;
  while (low < high) {
    const int middle = (low + high) / 2;
    if (x < points[middle])
      high = middle;
    else
      low = middle + 1;
  }
  return low;
}

/* The modes of an axis: the piece in which x lies or which it enters from a point, and whether the
 * direction from there is known. Returns 1 if the piece's polynomial is to be found: for order 0
 * its value, for order 1 and where the piece has become another one all that the series need. */
VS_INLINE int vs_place(double* mode, const Real* points, int count, const Real* x, int n) {
  if (n == 0) {
    const int piece = (int)mode[0];
    const int is_same =
        (piece == 0 || points[piece - 1] <= x[0]) && (piece == count || x[0] < points[piece]);
    if (!is_same) mode[0] = vs_count_below(points, count, x[0]);
    mode[1] = 0.0;
    return 1;
  }
  if (mode[1] != 0.0 || x[n] == 0.0) return n == 1;
  mode[1] = 1.0;
  if (!(x[n] < 0.0 && mode[0] > 0.0 && x[0] == points[(int)mode[0] - 1])) return n == 1;
  mode[0] -= 1.0;
  return 1;
}

/* c, a polynomial of degree 5 in x, becomes that in x + by. */
VS_INLINE void vs_shift(Real* c, int stride, Real by) {
  int i, k;
  VS_UNROLL
  for (k = 0; k < 5; ++k) {
    VS_UNROLL
    for (i = 4; i >= k; --i) c[stride * i] += by * c[stride * (i + 1)];
  }
}

/* The value of a polynomial of degree 5, c_0 after vs_shift. */
VS_INLINE Real vs_value_of_piece(const Real* c, Real by) {
  Real sum = c[5];
  int i;
  VS_UNROLL
  for (i = 4; i >= 0; --i) sum = c[i] + by * sum;
  return sum;
}

/* y = a_0 + a_1 t + t^2 q,  q = a_2 + a_3 t + t^2 p,  p = a_4 + a_5 t,  t = x - x_0
 * h: rows of t^2, p, q */
VS_INLINE void vs_follow_piece(Real* y, vs_row* h, const Real* x, const Real* a, int n) {
  const Real t = n == 0 ? vs_zero : x[n];
  h[0][n] = n == 0 ? vs_zero : vs_convolve_self(x, n, 1);
  h[1][n] = a[5] * t + (n == 0 ? a[4] : vs_zero);
  h[2][n] = a[3] * t + vs_convolve(h[0], h[1], n, 1, 0) + (n == 0 ? a[2] : vs_zero);
  y[n] = a[1] * t + vs_convolve(h[0], h[2], n, 1, 0) + (n == 0 ? a[0] : vs_zero);
}

/* Orders 0 to n - 1 of the piece, whose polynomial from x_0 on is a; of order 0 its value alone. */
VS_RARE void vs_enter_piece(Real* y, vs_row* h, const Real* x, const vs_table* table, double* mode,
                            Real* a, int n) {
  const int piece = (int)mode[0];
  const Real* const c = table->pieces + 6 * piece;
  const Real by = x[0] - table->points[piece > 0 ? piece - 1 : 0];
  int i, k;
  if (n == 0) {
    y[0] = vs_value_of_piece(c, by);
    return;
  }
  for (i = 0; i < 6; ++i) a[i] = c[i];
  vs_shift(a, 1, by);
  mode[2] = 1.0; /* constant */
  for (i = 1; i < 6; ++i) {
    if (a[i] != 0.0) mode[2] = 0.0;
  }
  for (k = 0; k < n; ++k) vs_follow_piece(y, h, x, a, k);
}

/* y = table(x); mode: 3 numbers, h: 3 rows, a: 6 numbers */
VS_INLINE void vs_look_up(Real* y, vs_row* h, const Real* x, const vs_table* table, double* mode,
                          Real* a, int n) {
  if (vs_place(mode, table->points, table->count, x, n)) {
    vs_enter_piece(y, h, x, table, mode, a, n);
  }
  if (n == 0) return;
  if (mode[2] != 0.0) {
    y[n] = 0.0;
  } else {
    vs_follow_piece(y, h, x, a, n);
  }
}

/* The piece of a table of two variables; x and y become distances from its corner. */
VS_INLINE const Real* vs_piece_of_two(const vs_table_of_two* table, const double* mode, Real* x,
                                      Real* y) {
  const int piece_x = (int)mode[0], piece_y = (int)mode[2];
  *x -= table->points_x[piece_x > 0 ? piece_x - 1 : 0];
  *y -= table->points_y[piece_y > 0 ? piece_y - 1 : 0];
  return table->pieces + 36 * (piece_x * (table->count_y + 1) + piece_y);
}

/* The polynomial of the piece from x and y on. */
VS_RARE void vs_cut_out(Real* a, const vs_table_of_two* table, const double* mode, Real x, Real y) {
  const Real* const c = vs_piece_of_two(table, mode, &x, &y);
  int i;
  for (i = 0; i < 36; ++i) a[i] = c[i];
  for (i = 0; i < 6; ++i) vs_shift(a + i, 6, x);
  for (i = 0; i < 6; ++i) vs_shift(a + 6 * i, 1, y);
}

/* Its value there, as vs_cut_out has it in a[0]. */
VS_RARE Real vs_value_of_two(const vs_table_of_two* table, const double* mode, Real x, Real y) {
  const Real* const c = vs_piece_of_two(table, mode, &x, &y);
  Real row[6];
  int i, j;
  for (j = 0; j < 6; ++j) {
    row[j] = c[30 + j];
    for (i = 4; i >= 0; --i) row[j] = c[6 * i + j] + x * row[j];
  }
  return vs_value_of_piece(row, y);
}

/* h_0 = table(x, y): with q_i = sum_j a_ij (y - y_0)^j, h_i = q_i + (x -
 * x_0) h_{i+1}, h_0 being the result. h: 6 rows of these and 5 of powers of y - y_0; mode: 4
 * numbers; a: 36 */
VS_RARE void vs_look_up_two(vs_row* h, const Real* x, const Real* y, const vs_table_of_two* table,
                            double* mode, Real* a, int n) {
  vs_row* const p = h + 6; /* p[j]: (y - y_0)^(j+1) */
  const int is_new_x = vs_place(mode, table->points_x, table->count_x, x, n);
  const int is_new_y = vs_place(mode + 2, table->points_y, table->count_y, y, n);
  int i, j, k = n;
  if (n == 0) {
    h[0][0] = vs_value_of_two(table, mode, x[0], y[0]);
    return;
  }
  if (is_new_x || is_new_y) {
    vs_cut_out(a, table, mode, x[0], y[0]);
    k = 0;
  }
  for (; k <= n; ++k) {
    for (j = 0; j < 5; ++j)
      p[j][k] = k == 0 ? vs_zero : j == 0 ? y[k] : vs_total(y, p[j - 1], k, 1, k);
    for (i = 5; i >= 0; --i) {
      Real sum = k == 0 ? a[6 * i] : vs_zero;
      for (j = 1; j < 6; ++j) sum += a[6 * i + j] * p[j - 1][k];
      if (i < 5 && k > 0) sum += vs_total(x, h[i + 1], k, 1, k);
      h[i][k] = sum;
    }
  }
}
