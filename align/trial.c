#include <stdlib.h>
#include <string.h>

#include "align/private.h"
#include "linalg/dense.h"

// Reframing stops when the frame turns by less.
static const double REFRAME_DEGREES = 5;

ep_status ep_trial_make(const ep_side *from, const ep_side *to, ep_trial *t, ep_error *err) {
  memset(t, 0, sizeof *t);
  t->p = malloc((size_t)from->n * sizeof *t->p);
  t->back = malloc((size_t)to->n * sizeof *t->back);
  ep_frame_identity(t->r);
  return t->p && t->back ? EP_OK : ep_fail(err, EP_ERR_MEMORY, "no memory for a map");
}

void ep_trial_free(ep_trial *t) {
  free(t->p);
  free(t->back);
  memset(t, 0, sizeof *t);
}

double ep_frame_between(const double a[9], const double b[9]) {
  double back[9], turn[9];
  ep_frame_transpose(b, back);
  ep_frame_multiply(a, back, turn);
  if (ep_determinant3(turn) < 0) return 180;
  return ep_frame_angle(turn);
}

ep_status ep_trial_run(const ep_side *from, const ep_side *to, const ep_match_rule *rule,
                       int rounds, ep_trial *t, ep_error *err) {
  const bool mirrored = ep_determinant3(t->r) < 0;
  EP_TRY(ep_match_levels(from, to, t->r, rule, t->p, NULL, NULL, err));
  for (t->rounds = 0; t->rounds < rounds; t->rounds++) {
    double turned[9];
    EP_TRY(ep_frame_from_map(from, to, t->p, mirrored, turned, err));
    if (ep_frame_between(turned, t->r) < REFRAME_DEGREES) break;
    memcpy(t->r, turned, sizeof turned);
    EP_TRY(ep_match_levels(from, to, t->r, rule, t->p, NULL, NULL, err));
  }
  double back[9];
  ep_frame_transpose(t->r, back);
  EP_TRY(ep_match_levels(to, from, back, rule, t->back, NULL, NULL, err));
  t->cycle = ep_match_cycle(from, t->p, t->back);
  return EP_OK;
}
