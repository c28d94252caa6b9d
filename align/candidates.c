// Frames an example may stand in, each tried on a few hundred samples: the authored one, those of
// regions and landmarks, principal axes with all half turns (and quarter turns where two axes are
// nearly as long), turns about a single landmark's direction; mirrored ones on request.
#include <float.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "align/private.h"
#include "linalg/dense.h"

void ep_candidates_free(ep_candidates *c) {
  if (!c) return;
  for (int i = 0; i < c->count; i++) free(c->p[i]);
  memset(c, 0, sizeof *c);
}

void ep_candidates_add(ep_candidates *c, const double r[9], const char *name) {
  if (c->count == EP_CANDIDATES_MAX) return;
  ep_frame_candidate *f = &c->frame[c->count++];
  memset(f, 0, sizeof *f);
  snprintf(f->name, sizeof f->name, "%s", name);
  memcpy(f->rotation, r, sizeof f->rotation);
  f->reflected = ep_determinant3(r) < 0;
  f->landmark = -1;
  const double identity[9] = {1, 0, 0, 0, 1, 0, 0, 0, 1};
  f->start_angle = f->reflected ? 180 : ep_frame_between(r, identity);
}

// The flip's name: which of the object's axes (longest first) it turns about.
static const char *flip_name(int flip) {
  static const char *const names[4] = {"axes", "axes, half turn about 3rd",
                                       "axes, half turn about 2nd", "axes, half turn about 1st"};
  return names[flip];
}

// Axes (rows of vf, vt: shortest first) matched with signs; swap: -1, or the lower of two axes
// whose lengths hardly differ, exchanged as well.
static void add_axes(ep_candidates *c, const double vf[9], const double vt[9], int swap,
                     bool mirrored) {
  double back[9];
  ep_frame_transpose(vf, back);
  for (int flip = 0; flip < 4; flip++) {
    double sign[3] = {flip & 1 ? -1 : 1, flip & 2 ? -1 : 1, 1}, turned[9], r[9];
    sign[2] = sign[0] * sign[1];
    memcpy(turned, vt, sizeof turned);
    if (swap >= 0)
      for (int i = 0; i < 3; i++) {
        turned[3 * swap + i] = vt[3 * (swap + 1) + i];
        turned[3 * (swap + 1) + i] = -vt[3 * swap + i];
      }
    for (int i = 0; i < 9; i++) turned[i] *= sign[i / 3] * (mirrored ? -1 : 1);
    ep_frame_multiply(back, turned, r);
    char name[32];
    static const char *const swapped[2] = {" 2/3", " 1/2"};
    // sign of rows 0 and 1: flip 1 keeps the middle axis, flip 2 the shortest, 3 the longest
    static const int order[4] = {0, 2, 1, 3};
    snprintf(name, sizeof name, "%s%s%s", mirrored ? "mirror " : "", flip_name(order[flip]),
             swap >= 0 ? swapped[swap] : "");
    ep_candidates_add(c, r, name);
  }
}

ep_status ep_candidates_add_axes(ep_candidates *c, const ep_side *from, const ep_side *to,
                                 bool mirrored, ep_error *err) {
  // Axes whose lengths differ by less may be exchanged between shapes: own choice.
  static const double NEAR_LENGTH = 1.25;
  double vf[9], vt[9], lf[3], lt[3];
  EP_TRY(ep_frame_axes(from, vf, lf, err));
  EP_TRY(ep_frame_axes(to, vt, lt, err));
  add_axes(c, vf, vt, -1, mirrored);
  for (int s = 0; s < 2; s++) {
    const double a = sqrt(lf[s + 1] / fmax(lf[s], 1e-12)), b = sqrt(lt[s + 1] / fmax(lt[s], 1e-12));
    if (fmin(a, b) < NEAR_LENGTH) add_axes(c, vf, vt, s, mirrored);
  }
  return EP_OK;
}

static void axis_turn(const double axis[3], double angle, double r[9]) {
  const double c = cos(angle), s = sin(angle);
  for (int i = 0; i < 3; i++)
    for (int j = 0; j < 3; j++) r[3 * i + j] = (1 - c) * axis[i] * axis[j] + (i == j ? c : 0);
  r[1] -= s * axis[2], r[2] += s * axis[1];
  r[3] += s * axis[2], r[5] -= s * axis[0];
  r[6] -= s * axis[1], r[7] += s * axis[0];
}

// Best rotation of the landmarks about the centroids; *spread: they fix it.
static ep_status frame_from_marks(const ep_side *from, const ep_side *to, double r[9], bool *spread,
                                  ep_error *err) {
  static const double SPREAD = 0.25; // second singular value over the first, own choice
  double s[9] = {0}, u[9], sigma[3], vt[9];
  for (int m = 0; m < from->marks; m++)
    for (int i = 0; i < 3; i++)
      for (int j = 0; j < 3; j++) s[3 * i + j] += from->mark_x[3 * m + i] * to->mark_x[3 * m + j];
  EP_TRY(ep_svd(3, 3, s, u, sigma, vt, err));
  *spread = sigma[1] > SPREAD * SPREAD * sigma[0] && sigma[0] > 0;
  // R = U diag(1, 1, d) V^T
  const double d = ep_determinant3(u) * ep_determinant3(vt) < 0 ? -1 : 1;
  for (int i = 0; i < 3; i++) u[3 * i + 2] *= d;
  ep_frame_multiply(u, vt, r);
  return EP_OK;
}

static ep_status add_landmarks(ep_candidates *c, const ep_side *from, const ep_side *to,
                               ep_error *err) {
  enum { TURNS = 12 };
  double r[9];
  bool spread;
  EP_TRY(frame_from_marks(from, to, r, &spread, err));
  ep_candidates_add(c, r, "landmarks");
  if (spread) return EP_OK;
  // A single direction is given: turn about it. The heaviest landmark's direction stands for it.
  const double *x = from->mark_x;
  double longest = 0, axis[3] = {0, 0, 1};
  for (int m = 0; m < from->marks; m++) {
    const double *y = from->mark_x + 3 * m;
    const double l = sqrt(y[0] * y[0] + y[1] * y[1] + y[2] * y[2]);
    if (l <= longest) continue;
    longest = l;
    x = y;
  }
  for (int i = 0; i < 3 && longest > 0; i++) axis[i] = x[i] / longest;
  for (int t = 1; t < TURNS; t++) {
    double turn[9], turned[9];
    char name[32];
    axis_turn(axis, 2 * acos(-1) * t / TURNS, turn);
    ep_frame_multiply(turn, r, turned);
    snprintf(name, sizeof name, "landmarks, turned by %d", 360 * t / TURNS);
    ep_candidates_add(c, turned, name);
  }
  return EP_OK;
}

static ep_status start_frames(const ep_side *from, const ep_side *to, const ep_match_rule *rule,
                              const ep_map_options *o, ep_candidates *c, ep_error *err) {
  double r[9];
  ep_frame_identity(r);
  ep_candidates_add(c, r, "authored");
  if (o->keep_frame) return EP_OK;
  bool found = false;
  if (rule->region_weight > 0) EP_TRY(ep_frame_from_regions(from, to, rule->use, r, &found, err));
  if (found) ep_candidates_add(c, r, "regions");
  if (found) c->preferred = 1;
  if (found) return EP_OK;
  if (o->same_family) {
    EP_TRY(ep_frame_from_axes(from, to, r, err));
    if (ep_frame_angle(r) > 5) ep_candidates_add(c, r, "axes");
    return EP_OK;
  }
  if (from->marks) EP_TRY(add_landmarks(c, from, to, err));
  EP_TRY(ep_candidates_add_axes(c, from, to, false, err));
  if (o->reflections) EP_TRY(ep_candidates_add_axes(c, from, to, true, err));
  return EP_OK;
}

// Landmarks in the frame alone: rms distance over the rms radius. The map's own images would
// flatter a wrong frame, because landmarks pull it.
static double mark_distance(const ep_side *from, const ep_side *to, const double r[9]) {
  double sum = 0;
  if (!from->marks) return -1;
  for (int m = 0; m < from->marks; m++) {
    double y[3];
    ep_frame_apply(1, r, to->mark_x + 3 * m, y);
    for (int c = 0; c < 3; c++) sum += pow(y[c] - from->mark_x[3 * m + c], 2);
  }
  return sqrt(sum / from->marks) / from->radius;
}

static double frame_distance(const ep_side *from, const ep_side *to, const ep_trial *t) {
  double sum = 0;
  for (int i = 0; i < from->n; i++) {
    double y[3];
    ep_frame_apply(1, t->r, to->x + 3 * (size_t)t->p[i], y);
    for (int c = 0; c < 3; c++) sum += from->share[i] * pow(y[c] - from->x[3 * (size_t)i + c], 2);
  }
  return sqrt(sum) / from->radius;
}

// How far the functional map is from commuting with the Laplacians, and from an isometry, on the
// first functions: both vanish for the right map between isometric shapes.
static ep_status functional_defects(const ep_side *from, const ep_side *to, const int *p,
                                    double *commuting, double *isometry, ep_error *err) {
  enum { FIRST = 10 };
  const int k = from->k, m = k < FIRST ? k : FIRST;
  double *c = malloc((size_t)k * k * sizeof *c);
  if (!c) return ep_fail(err, EP_ERR_MEMORY, "no memory for a functional map");
  const ep_status status = ep_match_functional(from, to, p, c, err);
  double sum = 0, all = 1e-300, gap = 0;
  const double *lf = from->shape->lb->lambda, *lt = to->shape->lb->lambda;
  for (int a = 0; a < m && status == EP_OK; a++)
    for (int b = 0; b < m; b++) {
      const double x = lf[a] * from->length * from->length, y = lt[b] * to->length * to->length;
      double g = 0;
      sum += pow(c[a * k + b] * (x - y) / (x + y), 2);
      all += pow(c[a * k + b], 2);
      for (int i = 0; i < k; i++) g += c[i * k + a] * c[i * k + b];
      gap += pow(g - (a == b), 2);
    }
  *commuting = sqrt(sum / all);
  *isometry = sqrt(gap / m);
  free(c);
  return status;
}

// Geometric mean of the defects: each separates frames on some shapes and fails on others. The
// floors are what sampling alone leaves.
static double score_of(const ep_frame_candidate *f, double commuting, double isometry) {
  const double mean =
      pow((0.05 + f->cycle) * (0.05 + f->distance) * (0.01 + commuting) * (0.03 + isometry), 0.25);
  return f->landmark >= 0 ? mean * (0.1 + f->landmark) : mean;
}

ep_status ep_candidates_run(const ep_side *from, const ep_side *to, const ep_match_rule *full,
                            int rounds, ep_candidates *c, int which, ep_error *err) {
  ep_match_rule steep = *full;
  const ep_match_rule *rule = &steep;
  steep.step = 3; // enough to tell frames apart
  ep_trial t;
  double commuting = 1, isometry = 1;
  ep_frame_candidate *f = &c->frame[which];
  ep_status status = ep_trial_make(from, to, &t, err);
  memcpy(t.r, f->rotation, sizeof t.r);
  if (status == EP_OK) status = ep_trial_run(from, to, rule, rounds, &t, err);
  if (status == EP_OK) status = functional_defects(from, to, t.p, &commuting, &isometry, err);
  if (status == EP_OK) {
    memcpy(f->rotation, t.r, sizeof t.r);
    f->cycle = t.cycle;
    f->distance = frame_distance(from, to, &t);
    f->landmark = mark_distance(from, to, t.r);
    f->score = score_of(f, commuting, isometry);
    f->rounds = t.rounds;
    c->p[which] = t.p;
    t.p = NULL;
  }
  ep_trial_free(&t);
  return status;
}

bool ep_candidates_repeats(const ep_candidates *c, int first, int which) {
  static const double SAME_START = 10; // degrees
  for (int i = first; i < which; i++)
    if (ep_frame_between(c->frame[i].rotation, c->frame[which].rotation) < SAME_START) return true;
  return false;
}

// Starts that need no trial: as one tried already, or much farther from the landmarks than another.
static bool worth_trying(const ep_candidates *c, int which, double best_mark, const ep_side *from,
                         const ep_side *to) {
  const ep_frame_candidate *f = &c->frame[which];
  if (ep_candidates_repeats(c, 0, which)) return false;
  return !from->marks || mark_distance(from, to, f->rotation) <= 2 * best_mark + 0.3;
}

void ep_candidates_drop(ep_candidates *c, int which) {
  free(c->p[which]);
  for (int i = which; i + 1 < c->count; i++) {
    c->frame[i] = c->frame[i + 1];
    c->p[i] = c->p[i + 1];
  }
  c->p[--c->count] = NULL;
}

// Rms distance of the images of two maps over to's rms radius.
double ep_candidates_difference(const ep_side *from, const ep_side *to, const int *p,
                                const int *q) {
  double sum = 0;
  for (int i = 0; i < from->n; i++)
    for (int c = 0; c < 3; c++)
      sum += from->share[i] * pow(to->x[3 * (size_t)p[i] + c] - to->x[3 * (size_t)q[i] + c], 2);
  return sqrt(sum) / to->radius;
}

// Choose, and mark the rivals: other maps whose score is not clearly worse.
static void choose(const ep_side *from, const ep_side *to, bool settled, ep_candidates *c) {
  static const double TURNED = 45; // degrees
  int best = 0;
  for (int i = 1; i < c->count; i++)
    if (c->frame[i].score < c->frame[best].score) best = i;
  // The authored (or the regions') frame is preferred unless it had to be turned far itself, or
  // landmarks say more.
  const bool stands = c->frame[c->preferred].reflected == false &&
                      ep_frame_angle(c->frame[c->preferred].rotation) < TURNED;
  const double margin = from->marks || (c->preferred == 0 && !stands) ? 1 : EP_FRAME_CLEARLY;
  c->chosen = c->frame[c->preferred].score <= margin * c->frame[best].score ? c->preferred : best;
  ep_frame_candidate *chosen = &c->frame[c->chosen];
  chosen->chosen = true;
  for (int i = 0; i < c->count && !settled; i++) {
    ep_frame_candidate *f = &c->frame[i];
    if (i == c->chosen || f->score >= EP_FRAME_CLEARLY * chosen->score) continue;
    f->rival = ep_candidates_difference(from, to, c->p[i], c->p[c->chosen]) > EP_FRAME_SAME;
    c->rivals += f->rival;
  }
}

// The sample the candidates send to places farthest apart (the least of the distances to the
// rivals' images): a landmark there settles the choice.
static void find_settling(const ep_side *from, const ep_side *to, ep_candidates *c) {
  double most = -1;
  c->settle_from = c->settle_to = c->settle_other = -1;
  for (int i = 0; i < from->n && c->rivals; i++) {
    const int here = c->p[c->chosen][i];
    double least = DBL_MAX;
    int nearest = -1;
    for (int k = 0; k < c->count; k++) {
      if (!c->frame[k].rival) continue;
      double d2 = 0;
      for (int a = 0; a < 3; a++)
        d2 += pow(to->x[3 * (size_t)here + a] - to->x[3 * (size_t)c->p[k][i] + a], 2);
      if (d2 >= least) continue;
      least = d2;
      nearest = c->p[k][i];
    }
    if (least <= most) continue;
    most = least;
    c->settle_from = i;
    c->settle_to = here;
    c->settle_other = nearest;
  }
}

ep_status ep_candidates_try(const ep_side *from, const ep_side *to, const ep_match_rule *rule,
                            const ep_map_options *o, ep_candidates *c, ep_error *err) {
  // Regions in wrong order would pull the frame farther with every round.
  const int rounds = rule->region_weight > 0 ? 0 : 4;
  memset(c, 0, sizeof *c);
  ep_status status = start_frames(from, to, rule, o, c, err);
  double best_mark = DBL_MAX;
  for (int i = 0; i < c->count; i++)
    best_mark = fmin(best_mark, mark_distance(from, to, c->frame[i].rotation));
  for (int i = 0; i < c->count && status == EP_OK; i++)
    if (i == 0 || worth_trying(c, i, best_mark, from, to))
      status = ep_candidates_run(from, to, rule, rounds, c, i, err);
    else
      ep_candidates_drop(c, i--);
  if (status != EP_OK) {
    ep_candidates_free(c);
    return status;
  }
  if (c->preferred >= c->count) c->preferred = 0;
  choose(from, to, o->keep_frame || o->same_family || rule->region_weight > 0, c);
  find_settling(from, to, c);
  status = ep_candidates_second_opinion(from, to, rule, o, c, err);
  if (status != EP_OK) ep_candidates_free(c);
  return status;
}
