// The Green-strain example potential (Zhang et al. 2015, eq. 7 to 10; docs/method.md
// "Green-strain path").
//
// The examples' strains E_j were orthonormalised offline in <A, B> = 1/2 sum V A : C : B, so that
// with y_i = <O_i, E(q)>, O = V-combinations of the E_j (w = V y), and weak constraints
//   W_a = min over y of |y|^2 - 2 y . y0 + sigma (sum w - 1)^2 + nu sum min(0, w_j)^2
// whose solution is C y = y0 + sigma a, C = I + sigma a a^T + nu sum_(w_j < 0) v_j v_j^T, a =
// V^T 1. By the envelope theorem the gradient is -2 y^T J and the Hessian -2 sum y_i B_i - 2 J^T
// C^-1 J. Without constraints C = I: that is w = Q^-1 w', W_a = -w'^T Q^-1 w' of the paper.
#include "reduced/green.h"

#include <math.h>
#include <string.h>

#include "reduced/green_weights.h"
#include "reduced/state.h"

ep_green_kernel ep_green_of(ep_isa isa) {
#if defined(__x86_64__)
  if (isa == EP_ISA_AVX512) return ep_green_avx512();
  if (isa == EP_ISA_AVX2) return ep_green_avx2();
#endif
  (void)isa;
  return ep_green_baseline();
}

int ep_green_valid(const ep_green *green) {
  return green->alpha >= 0 && green->alpha <= 1 && green->sum_to_one >= 0 &&
         isfinite(green->sum_to_one) && green->non_negative >= 0 && isfinite(green->non_negative);
}

static ep_green_problem problem_of(const ep_model *m, const ep_green *green) {
  return (ep_green_problem){.p = m->size.greens,
                            .k = m->size.k,
                            .v = m->green_weights,
                            .sigma = green->sum_to_one * m->green_scale[0],
                            .nu = green->non_negative * m->green_scale[0]};
}

// y, its weights and W_a; C's factor in green_c where there are constraints.
static double solve_weights(ep_state *state, const ep_green *green) {
  const ep_green_problem problem = problem_of(state->model, green);
  ep_green_solution solution = {.y = state->green_y,
                                .w = state->green_w,
                                .c = state->green_c,
                                .last = state->green_last,
                                .a = state->green_a,
                                .trial_w = state->green_trial_w};
  return ep_green_weights(&problem, state->green_y0, &solution);
}

// low := scale L^-1 J with C = L L^T (the identity without constraints).
static void lower_jacobian(ep_state *state, const ep_green *green, double scale) {
  const int p = state->model->size.greens, width = 8 * state->model->size.blocks;
  const ep_green_problem problem = problem_of(state->model, green);
  const double *l = ep_green_constrained(&problem) ? state->green_c : NULL;
  for (int i = 0; i < p; i++) {
    double *row = state->green_low + (size_t)i * (size_t)width;
    const double *from = state->green_jacobian + (size_t)i * (size_t)width;
    for (int a = 0; a < width; a++) row[a] = scale * from[a];
    for (int j = 0; l && j < i; j++) {
      const double *above = state->green_low + (size_t)j * (size_t)width;
      for (int a = 0; a < width; a++) row[a] -= l[p * i + j] * above[a];
    }
    for (int a = 0; l && a < width; a++) row[a] /= l[(p + 1) * i];
  }
}

double ep_green_add(ep_state *state, const ep_green *green, double strength, const double *q,
                    double *f, double *h) {
  const ep_model *m = state->model;
  const int r = m->size.r, p = m->size.greens, width = 8 * m->size.blocks;
  memcpy(state->padded_q, q, (size_t)r * sizeof *q); // its tail stays zero
  const ep_green_task task = {.count = p,
                              .blocks = m->size.blocks,
                              .b = m->green_b,
                              .linear = m->green_linear,
                              .z = state->padded_q,
                              .y = state->green_y0,
                              .jacobian = state->green_jacobian};
  state->green_kernel.products(&task);
  const double energy = solve_weights(state, green);
  for (int i = 0; f && i < p; i++) {
    const double *jacobian = state->green_jacobian + (size_t)i * (size_t)width;
    const double c = -2 * strength * state->green_y[i];
    for (int a = 0; a < r; a++) f[a] += c * jacobian[a];
  }
  if (h) {
    lower_jacobian(state, green, sqrt(2 * strength));
    for (int i = 0; i < p; i++) state->green_last[i] = -2 * strength * state->green_y[i];
    state->green_kernel.curvature(&task, r, state->green_last, state->green_low, h);
  }
  return strength * energy;
}

static int mixed(const ep_model *m, const ep_green *green) {
  return m->size.greens > 0 && green->alpha > 0 && m->material != EP_STVK &&
         m->material != EP_STVK_VOLUME;
}

double ep_green_share(const ep_model *model, const ep_green *green) {
  return mixed(model, green) ? 1 - green->alpha : 1;
}

double ep_green_potential(ep_state *state, const ep_green *green, const double *q, double *f,
                          double *h, int project) {
  const ep_model *m = state->model;
  const int r = m->size.r;
  if (m->size.greens == 0 || green->alpha == 0) return 0;
  double energy = 0;
  if (mixed(m, green)) {
    double *stvk_f = f ? state->green_f : NULL, *stvk_h = h ? state->green_h : NULL;
    state->term[0] = (ep_kernel_term){.scale = green->alpha, .weight = m->cubature_w};
    energy = ep_evaluate_law(state, EP_STVK_VOLUME, 1, q, stvk_f, stvk_h, project);
    for (int a = 0; f && a < r; a++) f[a] += stvk_f[a];
    for (int i = 0; h && i < r * r; i++) h[i] += stvk_h[i];
  }
  return energy + ep_green_add(state, green, green->alpha, q, f, h);
}

double ep_green_energy(ep_state *state, const ep_green *green, const double *q, double *f,
                       double *h) {
  const int r = state->model->size.r;
  if (f) memset(f, 0, (size_t)r * sizeof *f);
  if (h) memset(h, 0, (size_t)(r * r) * sizeof *h);
  return state->model->size.greens ? ep_green_add(state, green, 1, q, f, h) : 0;
}

const double *ep_state_green_weights(const ep_state *state) {
  return state->green_w;
}
