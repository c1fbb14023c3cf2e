/* Linear systems, real or complex, by L U with row exchanges; a complex one has its imaginary part
 * in an array of its own. Sums go over the envelope alone: from the first to the last element of a
 * row that may not be 0. */

VS_RARE void vs_swap(double* a, double* b, int first, int end) {
  int j;
  for (j = first; j < end; ++j) {
    const double kept = a[j];
    a[j] = b[j];
    b[j] = kept;
  }
}

/* L U of an n x n matrix with row exchanges; im: 0 of a real one. pivot: 3 n numbers, the
 * exchanges, which are found, and the first places and the ends of the rows' envelopes, which
 * change with the rows. False where it is singular. */
VS_RARE int vs_decompose(double* re, double* im, int n, int* pivot) {
  int *const begin = pivot + n, *const end = pivot + 2 * n;
  int i, j, p, reach = 0; /* the end of the rows that begin here or before */
  for (p = 0; p < n; ++p) {
    double largest = 0.0, square, a, b;
    pivot[p] = p;
    for (i = n; i > reach && begin[i - 1] > p; --i) continue;
    reach = i;
    for (i = p; i < reach; ++i) {
      const double size = fabs(re[n * i + p]) + (im != 0 ? fabs(im[n * i + p]) : 0.0);
      if (size > largest) {
        largest = size;
        pivot[p] = i;
      }
    }
    if (!(largest > 0.0) || !isfinite(largest)) return 0;
    if (pivot[p] != p) {
      const int other = pivot[p], first = begin[p], last = end[p];
      const int left = begin[other] < first ? begin[other] : first;
      const int right = end[other] > last ? end[other] : last;
      vs_swap(re + n * p, re + n * other, left, right);
      if (im != 0) vs_swap(im + n * p, im + n * other, left, right);
      begin[p] = begin[other];
      end[p] = end[other];
      begin[other] = first;
      end[other] = last;
    }
    a = re[n * p + p];
    b = im != 0 ? im[n * p + p] : 0.0;
    square = a * a + b * b;
    a /= square; /* 1 / (a + i b) */
    b /= -square;
    re[n * p + p] = a;
    if (im != 0) im[n * p + p] = b;
    for (i = p + 1; i < reach; ++i) {
      const double x = re[n * i + p], y = im != 0 ? im[n * i + p] : 0.0;
      const double f = x * a - y * b, g = x * b + y * a;
      if (x == 0.0 && y == 0.0) continue;
      if (end[i] < end[p]) end[i] = end[p];
      re[n * i + p] = f;
      for (j = p + 1; j < end[p]; ++j) re[n * i + j] -= f * re[n * p + j];
      if (im == 0) continue;
      im[n * i + p] = g;
      for (j = p + 1; j < end[p]; ++j) {
        re[n * i + j] += g * im[n * p + j];
        im[n * i + j] -= f * im[n * p + j] + g * re[n * p + j];
      }
    }
  }
  return 1;
}

/* x = M^-1 x by vs_decompose's factors. */
VS_RARE void vs_substitute(const double* re, const double* im, int n, const int* pivot, double* x,
                           double* y) {
  const int *const begin = pivot + n, *const end = pivot + 2 * n;
  int i, j;
  for (i = 0; i < n; ++i) {
    const double a = x[pivot[i]], b = im != 0 ? y[pivot[i]] : 0.0;
    x[pivot[i]] = x[i];
    x[i] = a;
    if (im == 0) continue;
    y[pivot[i]] = y[i];
    y[i] = b;
  }
  for (i = 0; i < n; ++i) {
    for (j = begin[i]; j < i; ++j) x[i] -= re[n * i + j] * x[j];
    for (j = begin[i]; j < i && im != 0; ++j) {
      x[i] += im[n * i + j] * y[j];
      y[i] -= re[n * i + j] * y[j] + im[n * i + j] * x[j];
    }
  }
  for (i = n - 1; i >= 0; --i) {
    double a, b;
    for (j = i + 1; j < end[i]; ++j) x[i] -= re[n * i + j] * x[j];
    for (j = i + 1; j < end[i] && im != 0; ++j) {
      x[i] += im[n * i + j] * y[j];
      y[i] -= re[n * i + j] * y[j] + im[n * i + j] * x[j];
    }
    a = x[i];
    b = im != 0 ? y[i] : 0.0;
    x[i] = re[n * i + i] * a - (im != 0 ? im[n * i + i] * b : 0.0);
    if (im != 0) y[i] = re[n * i + i] * b + im[n * i + i] * a;
  }
}
