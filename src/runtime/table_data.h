/* Tables: piecewise polynomials of degree 5. */

typedef struct {
  int count; /* of points */
  const SCENE_REAL* points;
  const SCENE_REAL* pieces; /* 6 coefficients of each of count + 1 pieces, from its lower point on;
                           of the lowest from the first */
} vs_table;

typedef struct {
  int count_x, count_y;
  const SCENE_REAL *points_x, *points_y;
  const SCENE_REAL* pieces; /* 6 times 6 coefficients of each piece, by x and then by y */
} vs_table_of_two;
