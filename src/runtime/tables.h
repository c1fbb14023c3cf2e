/* Power series of tables: piecewise polynomials of degree 5 of one variable or two (operations.h
 * goes before). */

typedef struct {
  int count; /* of points */
  const double* points;
  const double* pieces; /* 6 coefficients of each of count + 1 pieces, from its lower point on; of
                           the lowest from the first */
} vs_table;

typedef struct {
  int count_x, count_y;
  const double *points_x, *points_y;
  const double* pieces; /* 6 times 6 coefficients of each piece, by x and then by y */
} vs_table_of_two;

/* The modes of an axis: the piece in which x lies or which it enters from a point, and whether the
 * direction from there is known. Returns 1 if the piece has just become another one. */
VS_INLINE int vs_place(Real* mode, const double* points, int count, const Real* x, int n) {
  if (n == 0) {
    int piece = 0;
    while (piece < count && !(x[0] < points[piece])) ++piece;
    mode[0] = piece;
    mode[1] = 0.0;
    return 1;
  }
  if (mode[1] != 0.0 || x[n] == 0.0) return 0;
  mode[1] = 1.0;
  if (!(x[n] < 0.0 && mode[0] > 0.0 && x[0] == points[(int)mode[0] - 1])) return 0;
  mode[0] -= 1.0;
  return 1;
}

/* y = c_0 + c_1 t + t^2 q,  q = c_2 + c_3 t + t^2 p,  p = c_4 + c_5 t, t counting from the piece's
 * lower point. h: rows of t, t^2, p, q */
VS_INLINE void vs_follow_piece(Real* y, vs_row* h, const Real* x, const double* c, double low,
                               int n) {
  h[0][n] = n == 0 ? x[0] - low : x[n];
  vs_square(h[1], h[0], n);
  h[2][n] = c[5] * h[0][n] + (n == 0 ? c[4] : 0.0);
  h[3][n] = c[3] * h[0][n] + vs_convolve(h[1], h[2], n, 0, 0) + (n == 0 ? c[2] : 0.0);
  y[n] = c[1] * h[0][n] + vs_convolve(h[1], h[3], n, 0, 0) + (n == 0 ? c[0] : 0.0);
}

/* Orders 0 to n - 1 of a piece that has just been entered. */
VS_RARE void vs_enter_piece(Real* y, vs_row* h, const Real* x, const vs_table* table, Real* mode,
                            int n) {
  const int piece = (int)mode[0];
  const double* const c = table->pieces + 6 * piece;
  int i, k;
  mode[2] = 1.0; /* constant */
  for (i = 1; i < 6; ++i) {
    if (c[i] != 0.0) mode[2] = 0.0;
  }
  for (k = 0; k < n; ++k) {
    vs_follow_piece(y, h, x, c, table->points[piece > 0 ? piece - 1 : 0], k);
  }
}

/* y = table(x); mode: 3 numbers, h: 4 rows */
VS_INLINE void vs_look_up(Real* y, vs_row* h, const Real* x, const vs_table* table, Real* mode,
                          int n) {
  if (vs_place(mode, table->points, table->count, x, n)) {
    vs_enter_piece(y, h, x, table, mode, n == 0 ? 1 : n);
  }
  if (n == 0) return;
  if (mode[2] != 0.0) {
    y[n] = 0.0;
  } else {
    vs_follow_piece(y, h, x, table->pieces + 6 * (int)mode[0], 0.0, n);
  }
}

/* c, a polynomial of degree 5 in x, becomes that in x + by. */
VS_RARE void vs_shift(double* c, int stride, double by) {
  int i, k;
  for (k = 0; k < 5; ++k) {
    for (i = 4; i >= k; --i) c[stride * i] += by * c[stride * (i + 1)];
  }
}

/* The piece of a table of two variables, from x and y on. */
VS_RARE void vs_cut_out(double* a, const vs_table_of_two* table, const Real* mode, double x,
                        double y) {
  const int piece_x = (int)mode[0], piece_y = (int)mode[2];
  const double low_x = table->points_x[piece_x > 0 ? piece_x - 1 : 0];
  const double low_y = table->points_y[piece_y > 0 ? piece_y - 1 : 0];
  int i;
  for (i = 0; i < 36; ++i) {
    a[i] = table->pieces[36 * (piece_x * (table->count_y + 1) + piece_y) + i];
  }
  for (i = 0; i < 6; ++i) vs_shift(a + i, 6, x - low_x);
  for (i = 0; i < 6; ++i) vs_shift(a + 6 * i, 1, y - low_y);
}

/* h_0 = table(x, y): with q_i = sum_j a_ij (y - y_0)^j, h_i = q_i + (x -
 * x_0) h_{i+1}, h_0 being the result. h: 6 rows of these and 5 of powers of y - y_0; mode: 4
 * numbers; a: 36 */
VS_RARE void vs_look_up_two(vs_row* h, const Real* x, const Real* y, const vs_table_of_two* table,
                            Real* mode, double* a, int n) {
  vs_row* const p = h + 6; /* p[j]: (y - y_0)^(j+1) */
  const int is_new_x = vs_place(mode, table->points_x, table->count_x, x, n);
  const int is_new_y = vs_place(mode + 2, table->points_y, table->count_y, y, n);
  int i, j, k = n;
  if (is_new_x || is_new_y) {
    vs_cut_out(a, table, mode, x[0], y[0]);
    k = 0;
  }
  for (; k <= n; ++k) {
    for (j = 0; j < 5; ++j) p[j][k] = k == 0 ? 0.0 : j == 0 ? y[k] : vs_total(y, p[j - 1], k, 1, k);
    for (i = 5; i >= 0; --i) {
      Real sum = k == 0 ? a[6 * i] : 0.0;
      for (j = 1; j < 6; ++j) sum += a[6 * i + j] * p[j - 1][k];
      if (i < 5 && k > 0) sum += vs_total(x, h[i + 1], k, 1, k);
      h[i][k] = sum;
    }
  }
}
