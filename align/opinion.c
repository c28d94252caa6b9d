// A second opinion on a frame that landmarks, regions, the user or a family chose: what would the
// shapes alone say? Landmarks and regions pull a map, so that its own figures flatter them; a frame
// they turned over shows only where the shapes are matched without them.
#include <stdlib.h>
#include <string.h>

#include "align/private.h"

// An example stands as the object does where its own map turns the authored frame by less.
static const double STANDS = 30; // degrees
// A score that overrules who chose the frame is better by this factor: examples turned by half a
// turn had 2.2 to 7.5 (1.9 on a coarse mesh), a squatting gorilla the right way round 1.7 (its arms
// fit the other's legs).
static const double OVERRULES = 2;

static bool asked_for(const ep_match_rule *rule, const ep_map_options *o) {
  return o->keep_frame || o->same_family || o->landmarks || rule->region_weight > 0;
}

// The sides without landmarks and regions; borrowed.
static ep_side bare(const ep_side *side) {
  ep_side copy = *side;
  copy.marks = copy.regions = 0;
  copy.splines = false;
  return copy;
}

// Candidates from `first` on start from the chosen frame, the authored one and all flips.
static ep_status start_frames(const ep_side *from, const ep_side *to, ep_candidates *c,
                              ep_error *err) {
  double identity[9];
  ep_frame_identity(identity);
  ep_candidates_add(c, c->frame[c->chosen].rotation, "as chosen");
  ep_candidates_add(c, identity, "authored");
  return ep_candidates_add_axes(c, from, to, false, err);
}

// Whether candidate i contradicts the one at `first`, which is the choice seen alone. Where nobody
// gave a frame less is enough for a doubt.
static bool contradicts(const ep_candidates *c, bool given, int first, int i) {
  const ep_frame_candidate *mine = &c->frame[first], *f = &c->frame[i];
  if ((given ? OVERRULES : EP_FRAME_CLEARLY) * f->score < mine->score) return true;
  if (!given) return false;
  const bool stands = f->start_angle < 1 && ep_frame_angle(f->rotation) < STANDS;
  return stands && f->score < EP_FRAME_CLEARLY * mine->score;
}

static void compare(const ep_side *from, const ep_side *to, bool given, int first,
                    ep_candidates *c) {
  for (int i = first + 1; i < c->count; i++) {
    ep_frame_candidate *f = &c->frame[i];
    f->against = contradicts(c, given, first, i) &&
                 ep_candidates_difference(from, to, c->p[i], c->p[first]) > EP_FRAME_SAME;
    c->against += f->against;
  }
}

// Poses of a family nobody gave a frame for go where they fit far better.
static void take_better(int first, ep_candidates *c) {
  int best = first;
  for (int i = first + 1; i < c->count; i++)
    if (c->frame[i].against && c->frame[i].score < c->frame[best].score) best = i;
  if (OVERRULES * c->frame[best].score >= c->frame[first].score) return;
  c->frame[c->chosen].chosen = false;
  c->frame[best].chosen = true;
  c->frame[best].against = false;
  c->chosen = best;
  c->against = 0;
  for (int i = first; i < c->count; i++) c->frame[i].against = false;
}

// ---- exchanged partners ------------------------------------------------------------------------

// Two landmarks of which each comes, by the map p of the shapes alone, near the other's partner.
static void exchanged_marks(const ep_side *from, const ep_side *to, const int *p,
                            ep_candidates *c) {
  static const double NEARER = 0.5; // over the rms radius: own choice
  for (int a = 0; a < from->marks; a++)
    for (int b = 0; b < a; b++) {
      const double *ia = to->x + 3 * (size_t)p[from->mark_near[a]], *pa = to->mark_x + 3 * a;
      const double *ib = to->x + 3 * (size_t)p[from->mark_near[b]], *pb = to->mark_x + 3 * b;
      if (ep_points_distance(ia, pa) < ep_points_distance(ia, pb) + NEARER * to->radius ||
          ep_points_distance(ib, pb) < ep_points_distance(ib, pa) + NEARER * to->radius)
        continue;
      c->exchanged[0] = b;
      c->exchanged[1] = a;
      return;
    }
}

static ep_status exchanged_regions(const ep_side *from, const ep_side *to,
                                   const ep_match_rule *rule, const int *p, ep_candidates *c,
                                   ep_error *err) {
  const int count = from->regions;
  double *overlap = malloc((size_t)count * count * sizeof *overlap);
  if (!overlap) return ep_fail(err, EP_ERR_MEMORY, "no memory for %d regions", count);
  const ep_status status = ep_region_overlap(from, to, p, overlap, err);
  for (int a = 0; a < count && status == EP_OK; a++)
    for (int b = 0; b < a; b++) {
      const double aa = overlap[a * count + a], ab = overlap[a * count + b];
      const double bb = overlap[b * count + b], ba = overlap[b * count + a];
      if ((rule->use && !(rule->use[a] && rule->use[b])) || ab < aa + EP_REGION_CLEARLY ||
          ba < bb + EP_REGION_CLEARLY)
        continue;
      c->exchanged[0] = b;
      c->exchanged[1] = a;
    }
  free(overlap);
  return status;
}

ep_status ep_candidates_second_opinion(const ep_side *from, const ep_side *to,
                                       const ep_match_rule *rule, const ep_map_options *o,
                                       ep_candidates *c, ep_error *err) {
  enum { ROUNDS = 4 };
  c->exchanged[0] = c->exchanged[1] = -1;
  if (!asked_for(rule, o)) return EP_OK;
  const ep_side f = bare(from), t = bare(to);
  ep_match_rule alone = *rule;
  alone.region_weight = alone.mark_weight = 0;
  alone.use = NULL;
  const int first = c->count;
  EP_TRY(start_frames(&f, &t, c, err));
  for (int i = first; i < c->count; i++) {
    c->frame[i].alone = true;
    if (ep_candidates_repeats(c, first, i))
      ep_candidates_drop(c, i--);
    else
      EP_TRY(ep_candidates_run(&f, &t, &alone, ROUNDS, c, i, err));
  }
  const bool given = o->keep_frame || o->landmarks || rule->region_weight > 0;
  compare(&f, &t, given, first, c);
  if (!given) take_better(first, c);
  if (from->marks) exchanged_marks(from, to, c->p[first], c);
  if (rule->region_weight > 0 && c->exchanged[0] < 0)
    return exchanged_regions(from, to, rule, c->p[first], c, err);
  return EP_OK;
}
