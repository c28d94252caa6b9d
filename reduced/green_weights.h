// Private part of the Green-strain path, shared with its full-space version: weights of the
// examples under weak constraints, from the products y0 = <O, E> with the orthonormal strains.
//   minimise over y  |y|^2 - 2 y . y0 + sigma (sum w - 1)^2 + nu sum min(0, w_j)^2,   w = V y
// whose solution is C y = y0 + sigma a, C = I + sigma a a^T + nu sum_(w_j < 0) v_j v_j^T,
// a = V^T 1 (reduced/green.c).
#ifndef EP_REDUCED_GREEN_WEIGHTS_H
#define EP_REDUCED_GREEN_WEIGHTS_H

typedef struct ep_green_problem {
  int p, k;         // independent strains, examples
  const double *v;  // (k x p) V
  double sigma, nu; // [J]
} ep_green_problem;

typedef struct ep_green_solution {
  double *y, *w;              // (p), (k) out
  double *c;                  // (p x p) out: Cholesky factor of C; not touched without constraints
  double *last, *a, *trial_w; // (p), (p), (k) scratch
} ep_green_solution;

// Whether there is a constraint; without one C is the identity and y = y0.
int ep_green_constrained(const ep_green_problem *problem);
// Returns the minimum, NaN where the set of negative weights does not settle or y0 is not finite.
double ep_green_weights(const ep_green_problem *problem, const double *y0, ep_green_solution *out);
// C for the signs of the weights w (k), c (p x p); a (p) out: V^T 1.
void ep_green_system(const ep_green_problem *problem, const double *w, double *c, double *a);

#endif
