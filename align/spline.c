// Landmarks as the knots of splines. With four and more of them a shape gets one smooth function
// for each, 1 there and 0 at the others: polyharmonic splines made of the eigenfunctions,
//   K(x, y) = sum_f phi_f(x) phi_f(y) / lambda_f^2 + constant
// (the kernel of the biharmonic distance, Lipman, Rustamov & Funkhouser 2010). Half way along a
// limb they take the same values however long the limb is: coordinates of the product space between
// shapes of very different build, and what spreads the landmarks' displacements over the shape.
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "align/private.h"
#include "linalg/dense.h"

// Diagonal added to the kernel over its mean diagonal: landmarks are clicked, not measured.
static const double SOFT = 1e-3;
// The affine part is held to the identity by this share of a well-spread landmark: measured, .05
// lets four landmarks of a beast shear its legs (error 3.7 instead of .6 per cent), 2 is as good as
// .5 but for plane and fish.
static const double RIDGE = 0.5;

// kernel (n x marks): K(x_i, landmark), over its mean diagonal before the constant.
static void fill_kernel(const ep_side *side, double *kernel) {
  const ep_lb *lb = side->shape->lb;
  const int n = side->n, marks = side->marks;
  for (int f = 0; f < lb->m; f++) {
    const double l = lb->lambda[f] * side->length * side->length;
    const double *phi = lb->phi + (size_t)f * n;
    for (int m = 0; m < marks; m++) {
      const double at = lb->volume * phi[side->mark_near[m]] / (l * l);
      for (int i = 0; i < n; i++) kernel[(size_t)i * marks + m] += at * phi[i];
    }
  }
  double mean = 0;
  for (int m = 0; m < marks; m++) mean += kernel[(size_t)side->mark_near[m] * marks + m] / marks;
  for (size_t i = 0; i < (size_t)n * marks; i++) kernel[i] = kernel[i] / mean + 1;
}

ep_status ep_side_splines(ep_side *side, ep_error *err) {
  const size_t marks = (size_t)side->marks;
  double *kernel = calloc((size_t)side->n * marks, sizeof *kernel);
  double *gram = malloc(2 * marks * marks * sizeof *gram), *inverse = gram + marks * marks;
  ep_status status = kernel && gram
                         ? EP_OK
                         : ep_fail(err, EP_ERR_MEMORY, "no memory for %d landmarks", side->marks);
  if (status == EP_OK) {
    fill_kernel(side, kernel);
    for (size_t m = 0; m < marks; m++) {
      memcpy(gram + m * marks, kernel + (size_t)side->mark_near[m] * marks, marks * sizeof *gram);
      for (size_t k = 0; k < marks; k++) inverse[m * marks + k] = m == k;
      gram[m * marks + m] += SOFT;
    }
    side->mark_gram = malloc(marks * marks * sizeof *gram);
    if (side->mark_gram)
      memcpy(side->mark_gram, gram, marks * marks * sizeof *gram);
    else
      status = ep_fail(err, EP_ERR_MEMORY, "no memory for %d landmarks", side->marks);
  }
  if (status == EP_OK) status = ep_solve_spd(side->marks, gram, side->marks, inverse, err);
  if (status == EP_OK) ep_gemm(side->n, side->marks, side->marks, kernel, inverse, side->mark);
  free(kernel);
  free(gram);
  return status;
}

// Least squares y ~ (I + A) x + t over `count` points, A and t held towards zero: g (4 x 3), the
// rows of A^T and t.
static ep_status fit_affine(int count, const double *x, const double *y, double radius,
                            double g[12], ep_error *err) {
  double gram[16] = {0};
  memset(g, 0, 12 * sizeof *g);
  for (int m = 0; m < count; m++) {
    const double h[4] = {x[3 * m], x[3 * m + 1], x[3 * m + 2], 1};
    for (int i = 0; i < 4; i++) {
      for (int j = 0; j < 4; j++) gram[4 * i + j] += h[i] * h[j];
      for (int c = 0; c < 3; c++) g[3 * i + c] += h[i] * (y[3 * m + c] - x[3 * m + c]);
    }
  }
  for (int i = 0; i < 4; i++) gram[5 * i] += RIDGE * count * (i < 3 ? radius * radius / 3 : 1);
  return ep_solve_spd(4, gram, 3, g, err);
}

static void add_affine(int count, const double g[12], const double *x, double *y) {
  for (int i = 0; i < count; i++)
    for (int c = 0; c < 3; c++)
      y[3 * (size_t)i + c] += g[c] * x[3 * (size_t)i] + g[3 + c] * x[3 * (size_t)i + 1] +
                              g[6 + c] * x[3 * (size_t)i + 2] + g[9 + c];
}

ep_status ep_side_warp(const ep_side *from, const double *partner, double *y, ep_error *err) {
  const int count = from->marks;
  memcpy(y, from->x, 3 * (size_t)from->n * sizeof *y);
  if (!from->splines) return EP_OK;
  double g[12], *left = malloc(3 * (size_t)count * sizeof *left);
  double *shift = malloc(3 * (size_t)from->n * sizeof *shift);
  ep_status status = left && shift
                         ? fit_affine(count, from->mark_x, partner, from->radius, g, err)
                         : ep_fail(err, EP_ERR_MEMORY, "no memory for %d points", from->n);
  if (status == EP_OK) {
    add_affine(from->n, g, from->x, y);
    for (int i = 0; i < 3 * count; i++) left[i] = from->mark_x[i];
    add_affine(count, g, from->mark_x, left);
    for (int i = 0; i < 3 * count; i++) left[i] = partner[i] - left[i];
    ep_gemm(from->n, 3, count, from->mark, left, shift);
    for (size_t i = 0; i < 3 * (size_t)from->n; i++) y[i] += shift[i];
  }
  free(left);
  free(shift);
  return status;
}
