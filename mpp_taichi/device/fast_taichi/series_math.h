/* Series of order P in Cartesian coordinates. A multi-index n = (i, j, k) has the order |n| = i + j + k, n! = i! j! k!, and
 * x^n = x^i y^j z^k. Bodies of mass m_b act at x by  psi(x) = sum_b m_b / rho(x - x_b),  rho(x)^2 = |x|^2 + softening^2.
 *
 *   moments of a source about c    M_n = sum_b m_b (c - x_b)^n / (n! s^|n|),  |n| < P,  M_n = 0 for |n| = 1
 *   series of a target about z     psi(z + y) = sum_n L_n y^n / (n! t^|n|),   |n| <= P
 *   derivatives                    D_n = rho^(|n|+1) d^n (1/rho)
 *   what a source adds             L_n += (t/rho)^|n| sum_m (s/rho)^|m| M_m D_(n+m)(z - c) / rho,   |n| + |m| <= P
 *
 * Lengths s and t, the radii of source and target, keep the numbers of all orders in the range of f32. Moments of order P
 * would act on the potential only, and are left out. Source: W. Dehnen, J. Comput. Phys. 179 (2002) 27, sec. 3; Comput.
 * Astrophys. Cosmol. 1 (2014) 1.
 */
#define COUNT(order) (((order) + 1) * ((order) + 2) * ((order) + 3) / 6) /* multi-indices up to an order */
#define SERIES COUNT(P)
#define MOMENTS COUNT(P - 1)
#define WIDTH(n) (((n) + 1) * ((n) + 2) / 2) /* multi-indices of an order */
#define AT(i, j, k) (COUNT((i) + (j) + (k) - 1) + WIDTH((j) + (k) - 1) + (k)) /* place of a multi-index; lower orders first */
#define EACH(n, i, j) UNROLL for (int i = (n); i >= 0; i--) UNROLL for (int j = (n) - i; j >= 0; j--)

/* D_n = D^0_n of x / rho, by the recurrence  D^m_(n+e_a) = x_a D^(m+1)_n + n_a D^(m+1)_(n-e_a),  D^m_0 = (-1)^m (2m - 1)!!
 * (L. McMurchie and E. Davidson, J. Comput. Phys. 26 (1978) 218). An axis along which n is 1 costs a product only. */
INLINE void find_derivatives(const vector *x, vector *result) {
    vector level[P + 1][SERIES];
    REAL start = 1;
    UNROLL for (int m = 0; m <= P; m++) {
        level[m][0] = all(start);
        start *= -(2 * m + 1);
    }
    UNROLL for (int n = 1; n <= P; n++) EACH(n, i, j) {
        const int k = n - i - j;
        const int axis = k == 1 ? 2 : j == 1 ? 1 : i == 1 ? 0 : k > 0 ? 2 : j > 0 ? 1 : 0;
        const int a = i - (axis == 0), b = j - (axis == 1), c = k - (axis == 2), left = axis == 0 ? a : axis == 1 ? b : c;
        UNROLL for (int m = 0; m <= P - n; m++) {
            vector value = x[axis] * level[m + 1][AT(a, b, c)];
            if (left > 0) value += (REAL)left * level[m + 1][AT(a - (axis == 0), b - (axis == 1), c - (axis == 2))];
            level[m][AT(i, j, k)] = value;
        }
    }
    UNROLL for (int n = 0; n < SERIES; n++) result[n] = level[0][n];
}

/* The terms of order n of the series: all multi-indices at a time, which share each moment in a register. */
INLINE void add_order(int n, const vector *derivative, const vector *moment, vector power, vector *series) {
    vector sum[WIDTH(P)];
    const int first = COUNT(n - 1);
    UNROLL for (int k = 0; k < WIDTH(n); k++) sum[k] = moment[0] * derivative[first + k];
    UNROLL for (int m = 2; m <= (n == 0 ? P - 1 : P - n); m++) EACH(m, a, b) {
        const vector factor = moment[AT(a, b, m - a - b)];
        EACH(n, i, j) sum[AT(i, j, n - i - j) - first] += factor * derivative[AT(i + a, j + b, n - i - j + m - a - b)];
    }
    UNROLL for (int k = 0; k < WIDTH(n); k++) series[first + k] += power * sum[k];
}

/* Add the chosen of LANES sources to LANES partial series. The separations are z - c; the scales are s; t is the target's. */
INLINE void add_sources(const vector *separation, vector scale, vector *moment, vector squared, REAL t, __mmask16 chosen,
                        int potential, vector *series) {
    vector x[3], derivative[SERIES];
    const vector inverse = inverse_root(squared), per_source = scale * inverse, per_target = t * inverse;
    UNROLL for (int a = 0; a < 3; a++) x[a] = separation[a] * inverse;
    find_derivatives(x, derivative);
    vector power = add_chosen(all(0), chosen, inverse);
    UNROLL for (int m = 0; m < P; m++) {
        UNROLL for (int k = 0; k < WIDTH(m); k++) moment[COUNT(m - 1) + k] *= power;
        power *= per_source;
    }
    if (potential) add_order(0, derivative, moment, all(1), series);
    power = per_target;
    UNROLL for (int n = 1; n <= P; n++) {
        add_order(n, derivative, moment, power, series);
        power *= per_target;
    }
}

#define DEFINE_POWERS(NAME, KIND, ONE)                                                        \
    INLINE void NAME(const KIND *x, int order, KIND *result) { /* x^n / n! */                 \
        result[0] = ONE;                                                                      \
        UNROLL for (int n = 1; n <= order; n++) EACH(n, i, j) {                               \
            const int k = n - i - j, axis = k > 0 ? 2 : j > 0 ? 1 : 0;                        \
            const REAL share = (REAL)1 / (axis == 2 ? k : axis == 1 ? j : i);                 \
            const int before = AT(i - (axis == 0), j - (axis == 1), k - (axis == 2));         \
            result[AT(i, j, k)] = result[before] * (x[axis] * share);                         \
        }                                                                                     \
    }
DEFINE_POWERS(find_powers, vector, all(1))
DEFINE_POWERS(find_powers_of_one, REAL, 1)

/* Add the moments of a part to the moments of the whole; `shift` is the center of the whole minus that of the part, in units of
 * the whole's scale, and `ratio` is the part's scale in these units. */
ALONE void add_moments(const REAL *part, const REAL *shift, REAL ratio, REAL *whole) {
    REAL power[MOMENTS], own[MOMENTS], scale = 1;
    find_powers_of_one(shift, P - 1, power);
    UNROLL for (int n = 0; n < P; n++) {
        UNROLL for (int k = 0; k < WIDTH(n); k++) own[COUNT(n - 1) + k] = scale * part[COUNT(n - 1) + k];
        scale *= ratio;
    }
    UNROLL for (int n = 0; n < P; n++) EACH(n, i, j) {
        const int k = n - i - j;
        REAL sum = whole[AT(i, j, k)];
        UNROLL for (int a = 0; a <= i; a++) UNROLL for (int b = 0; b <= j; b++) UNROLL for (int c = 0; c <= k; c++)
            sum += own[AT(a, b, c)] * power[AT(i - a, j - b, k - c)];
        whole[AT(i, j, k)] = sum;
    }
}

/* The series of a parent about the center of a child; `shift` is the child's center minus the parent's, in units of the
 * parent's scale, and `ratio` is the child's scale in these units. */
ALONE void hand_down(const REAL *parent, const REAL *shift, REAL ratio, REAL *child) {
    REAL power[SERIES], scale = 1;
    find_powers_of_one(shift, P, power);
    UNROLL for (int n = 0; n <= P; n++) {
        EACH(n, i, j) {
            REAL sum = 0;
            UNROLL for (int m = 0; m <= P - n; m++) EACH(m, a, b)
                sum += parent[AT(i + a, j + b, n - i - j + m - a - b)] * power[AT(a, b, m - a - b)];
            child[AT(i, j, n - i - j)] = scale * sum;
        }
        scale *= ratio;
    }
}

/* Gradient of a series at LANES places y, in units of the scale; the gradient is in these units, too. */
INLINE void find_gradient(const REAL *series, const vector *power, vector *result) {
    UNROLL for (int a = 0; a < 3; a++) result[a] = all(0);
    UNROLL for (int n = 0; n < P; n++) EACH(n, i, j) {
        const int k = n - i - j;
        result[0] += power[AT(i, j, k)] * series[AT(i + 1, j, k)];
        result[1] += power[AT(i, j, k)] * series[AT(i, j + 1, k)];
        result[2] += power[AT(i, j, k)] * series[AT(i, j, k + 1)];
    }
}
