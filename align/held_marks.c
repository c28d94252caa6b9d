// Landmarks held out, each in its turn: the others make a map without it, and where that sends its
// vertex tells whether its partner is the right one. A landmark pulls its own map towards its
// partner, right or wrong; a map without it is a witness.
#include <float.h>
#include <stdlib.h>
#include <string.h>

#include "align/private.h"
#include "linalg/dense.h"

// With fewer left splines extrapolate too much (landmarks.c).
enum { LEFT_LEAST = 4 };
// Another landmark's partner is clearly nearer than the own one by this, over the rms radius: half
// a shape. Right landmarks of plane and fish missed by up to 1.6 and came within .4 of another's
// partner; swapped ones missed by 2.5 to 4.
static const double NEARER = 1.5;

// mark (n x marks - 1) of the side without landmark `out`: the kernel is S G, S the splines there
// are and G their matrix between landmarks; the splines of the others are made of it anew.
static ep_status splines_without(const ep_side *side, int out, double *mark, ep_error *err) {
  const int count = side->marks, left = count - 1;
  double *kernel = malloc((size_t)side->n * count * sizeof *kernel);
  double *few = malloc((size_t)side->n * left * sizeof *few);
  double *gram = malloc(2 * (size_t)left * left * sizeof *gram);
  ep_status status = kernel && few && gram
                         ? EP_OK
                         : ep_fail(err, EP_ERR_MEMORY, "no memory for %d landmarks", count);
  if (status == EP_OK) {
    double *inverse = gram + (size_t)left * left;
    ep_gemm(side->n, count, count, side->mark, side->mark_gram, kernel);
    for (int i = 0; i < side->n; i++)
      for (int a = 0, c = 0; a < count; a++)
        if (a != out) few[(size_t)i * left + c++] = kernel[(size_t)i * count + a];
    for (int a = 0, r = 0; a < count; a++) {
      if (a == out) continue;
      for (int b = 0, c = 0; b < count; b++)
        if (b != out) gram[r * left + c++] = side->mark_gram[a * count + b];
      for (int c = 0; c < left; c++) inverse[r * left + c] = r == c;
      r++;
    }
    status = ep_solve_spd(left, gram, left, inverse, err);
    if (status == EP_OK) ep_gemm(side->n, left, left, few, inverse, mark);
  }
  free(kernel);
  free(few);
  free(gram);
  return status;
}

// The side without landmark `out`; mark, mark_x, mark_near are the copy's own, the rest is
// borrowed.
static ep_status leave_out(const ep_side *side, int out, ep_side *copy, ep_error *err) {
  const int left = side->marks - 1;
  *copy = *side;
  copy->marks = left;
  copy->mark = malloc((size_t)side->n * left * sizeof *copy->mark);
  copy->mark_x = malloc(3 * (size_t)left * sizeof *copy->mark_x);
  copy->mark_near = malloc((size_t)left * sizeof *copy->mark_near);
  if (!copy->mark || !copy->mark_x || !copy->mark_near)
    return ep_fail(err, EP_ERR_MEMORY, "no memory for %d landmarks", left);
  for (int a = 0, c = 0; a < side->marks; a++) {
    if (a == out) continue;
    memcpy(copy->mark_x + 3 * c, side->mark_x + 3 * a, 3 * sizeof *copy->mark_x);
    copy->mark_near[c++] = side->mark_near[a];
  }
  return splines_without(side, out, copy->mark, err);
}

static void forget(ep_side *copy) {
  free(copy->mark);
  free(copy->mark_x);
  free(copy->mark_near);
}

static void judge(const ep_side *to, int which, const double *image, ep_landmark_quality *out) {
  double least = DBL_MAX;
  int nearest = which;
  for (int a = 0; a < to->marks; a++) {
    const double away = ep_points_distance(image, to->mark_x + 3 * a) / to->radius;
    if (away >= least) continue;
    least = away;
    nearest = a;
  }
  out->held_out = ep_points_distance(image, to->mark_x + 3 * which) / to->radius;
  out->best_match = out->held_out > least + NEARER ? nearest : which;
}

static ep_status hold_out(const ep_side *from, const ep_side *to, const ep_match_rule *rule,
                          const double r[9], int which, int *p, ep_landmark_quality *out,
                          ep_error *err) {
  ep_side f = {0}, t = {0};
  ep_status status = leave_out(from, which, &f, err);
  if (status == EP_OK) status = leave_out(to, which, &t, err);
  if (status == EP_OK) status = ep_match_levels(&f, &t, r, rule, p, NULL, NULL, err);
  if (status == EP_OK) judge(to, which, to->x + 3 * (size_t)p[from->mark_near[which]], out);
  forget(&f);
  forget(&t);
  return status;
}

ep_status ep_held_marks(const ep_side *from, const ep_side *to, const ep_match_rule *rule,
                        const double r[9], ep_landmark_quality *out, ep_error *err) {
  for (int m = 0; m < from->marks; m++) out[m] = (ep_landmark_quality){-1, m};
  if (from->marks <= LEFT_LEAST || !from->mark_gram || !to->mark_gram) return EP_OK;
  ep_match_rule coarse = *rule;
  coarse.step = 3;
  int *p = malloc((size_t)from->n * sizeof *p);
  ep_status status = p ? EP_OK : ep_fail(err, EP_ERR_MEMORY, "no memory for a map");
  for (int m = 0; m < from->marks && status == EP_OK; m++)
    status = hold_out(from, to, &coarse, r, m, p, &out[m], err);
  free(p);
  return status;
}
