#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "align/private.h"
#include "linalg/dense.h"

// Weights and numbers of functions measured over eleven pairs of shapes (docs/method.md
// "Maps"). Between poses of one family positions mislead more.
static const double GAMMA_SHAPES = 4, GAMMA_FAMILY = 2;
enum { FUNCTIONS_SHAPES = 12, FUNCTIONS_FAMILY = 20 };
// Shapes of one family agree in their finer functions too. Mean error of nine maps rest <- pose
// with 20, 30, 40, 60: .82, .64, .56, .48 per cent of the diagonal. Only the last rounds take them.
// Coarse meshes do not resolve more than some 30: the pose of a car of 1,019 vertices had 3, 5, 13
// inverted tets before repair with 20, 32, 40. So EP_MAP_SPACE_FAMILY, by steps of
enum { FINE_STEP = 4 };
static const double REGION_WEIGHT = 2; // measured useful: 1 to 3
// Of that in the elastic refinement, where images gather along the regions' borders: at the full
// weight the energy of gorilla and letter-c is twice as high, at a quarter regions slip.
static const double REGION_SHARE = 0.5;
static const double MARK_WEIGHT = 2;
// Skin goes to skin: where build differs the nearest point would lie inside. 1 and 4 measured the
// same, both better than 0 on nine of eleven pairs (bar to rod 1.6 to 1.1 per cent), worse by .03
// on one.
static const double SKIN_WEIGHT = 1;
// Elastic refinement. Between shapes .01 to .06 measured much the same. Poses of one family need
// less smoothing, and what is stiff straightens what bends: nine maps rest <- pose with .1, .03,
// .01, .003, .001 (docs/maps.md).
static const double STIFFNESS_SHAPES = 0.03, STIFFNESS_FAMILY = 0.003;
// Little stiffness moves long waves little in a round: within a family momentum makes up for it.
// Between shapes of different build the least energy lies beside the truth, and stopping early is
// better (plane to bird: six landmarks, 24 rounds with rising momentum .61 to 1.09 per cent).
static const double MOMENTUM_FAMILY = 0.6;
enum { ROUNDS_SHAPES = 8, ROUNDS_FAMILY = 12 };
// Reframing (step 4): at most so many rounds, until the frame turns by less.
enum { REFRAME_ROUNDS = 4, DROP_ROUNDS = 3 };
// Above this round trip plain nearest neighbours are tried as well (step 5).
static const double CYCLE_FALLBACK = 0.3;
ep_map_options ep_default_map_options(void) {
  return (ep_map_options){.m = 10, .to_column = 1};
}

void ep_map_free(ep_map *map) {
  if (!map) return;
  free(map->p);
  free(map->tet);
  free(map->weight);
  free(map->c);
  free(map->a);
  free(map->quality.region);
  free(map->quality.landmark);
  free(map->quality.candidate);
  memset(map, 0, sizeof *map);
}

void ep_map_pull(const ep_map *map, const ep_mesh *to, int width, const double *values,
                 double *out) {
  const ep_point_map points = {map->p, map->tet, map->weight};
  ep_point_map_pull(&points, map->n, to, width, values, out);
}

typedef struct job {
  const ep_map_options *options;
  ep_side from, to;
  unsigned char *use; // (regions) that take part, NULL without regions
  ep_log *log;
  ep_candidates candidates;
  ep_landmark_quality held[EP_LANDMARKS_MAX]; // landmarks held out, in the chosen frame
  ep_trial other; // where the round trip is long: the second of matching and plain neighbours
} job;

static ep_match_rule rule_of(const job *j) {
  const bool family = j->options->same_family;
  int k = family ? FUNCTIONS_FAMILY : FUNCTIONS_SHAPES;
  if (k < j->options->m) k = j->options->m;
  return (ep_match_rule){.step = 1,
                         .k = k < j->from.k ? k : j->from.k,
                         .gamma = family ? GAMMA_FAMILY : GAMMA_SHAPES,
                         .region_weight = j->use ? REGION_WEIGHT : 0,
                         .skin_weight = SKIN_WEIGHT,
                         .stiffness = family ? STIFFNESS_FAMILY : STIFFNESS_SHAPES,
                         .rounds = family ? ROUNDS_FAMILY : ROUNDS_SHAPES,
                         .momentum = family ? MOMENTUM_FAMILY : 0,
                         .mark_weight = j->options->landmarks ? MARK_WEIGHT : 0,
                         .use = j->use};
}

// Samples on which frames are tried; on which sides with more vertices are matched first.
enum { SCOUTS = 800, MATCH_SAMPLES = 4000 };

typedef struct coarse_side {
  ep_side side;
  int *sample, *owner; // (side.n) vertices; (vertices) nearest sample
} coarse_side;

static void free_coarse(coarse_side *c) {
  ep_side_free(&c->side);
  free(c->sample);
  free(c->owner);
}

static ep_status coarsen(const ep_side *side, int most, coarse_side *out, ep_error *err) {
  const int count = side->n < most ? side->n : most;
  out->sample = malloc((size_t)count * sizeof *out->sample);
  out->owner = malloc((size_t)side->n * sizeof *out->owner);
  return out->sample && out->owner
             ? ep_side_coarsen(side, count, &out->side, out->sample, out->owner, err)
             : ep_fail(err, EP_ERR_MEMORY, "no memory for samples");
}

// Try the frames on samples; candidates' samples become vertices.
static ep_status choose_frame(job *j, const ep_match_rule *rule, ep_error *err) {
  coarse_side from = {0}, to = {0};
  ep_candidates *c = &j->candidates;
  ep_candidates_free(c);
  ep_status status = coarsen(&j->from, SCOUTS, &from, err);
  if (status == EP_OK) status = coarsen(&j->to, SCOUTS, &to, err);
  if (status == EP_OK) status = ep_candidates_try(&from.side, &to.side, rule, j->options, c, err);
  if (status == EP_OK && from.side.marks)
    status = ep_held_marks(&from.side, &to.side, rule, c->frame[c->chosen].rotation, j->held, err);
  if (status == EP_OK && c->rivals) {
    c->settle_from = from.sample[c->settle_from];
    c->settle_to = to.sample[c->settle_to];
    c->settle_other = to.sample[c->settle_other];
  }
  free_coarse(&from);
  free_coarse(&to);
  return status;
}

// The map on samples of large sides, carried over to all vertices: p of t.
static ep_status match_samples(const job *j, const ep_match_rule *rule, ep_trial *t,
                               ep_error *err) {
  coarse_side from = {0}, to = {0};
  ep_trial c = {0};
  ep_status status = coarsen(&j->from, MATCH_SAMPLES, &from, err);
  if (status == EP_OK) status = coarsen(&j->to, MATCH_SAMPLES, &to, err);
  if (status == EP_OK) status = ep_trial_make(&from.side, &to.side, &c, err);
  if (status == EP_OK) {
    memcpy(c.r, t->r, sizeof c.r);
    status = ep_trial_run(&from.side, &to.side, rule, REFRAME_ROUNDS, &c, err);
  }
  if (status == EP_OK) {
    memcpy(t->r, c.r, sizeof c.r);
    t->rounds = c.rounds;
    for (int i = 0; i < j->from.n; i++) t->p[i] = to.sample[c.p[from.owner[i]]];
    for (int i = 0; i < j->to.n; i++) t->back[i] = from.sample[c.back[to.owner[i]]];
  }
  ep_trial_free(&c);
  free_coarse(&from);
  free_coarse(&to);
  return status;
}

// Extend the samples' map to all vertices: the last level alone, both ways.
static ep_status extend(const job *j, const ep_match_rule *rule, ep_trial *t, ep_error *err) {
  double back[9];
  ep_match_rule last = *rule;
  last.refine = true;
  ep_frame_transpose(t->r, back);
  EP_TRY(ep_match_levels(&j->from, &j->to, t->r, &last, t->p, NULL, NULL, err));
  EP_TRY(ep_match_levels(&j->to, &j->from, back, &last, t->back, NULL, NULL, err));
  t->cycle = ep_match_cycle(&j->from, t->p, t->back);
  return EP_OK;
}

// Nearest neighbours in space too: first the one whose round trip is shorter. *other: the second.
static ep_status try_plain(const job *j, ep_trial *best, ep_trial *other, ep_error *err) {
  double back[9];
  EP_TRY(ep_trial_make(&j->from, &j->to, other, err));
  memcpy(other->r, best->r, sizeof other->r);
  ep_frame_transpose(other->r, back);
  EP_TRY(ep_match_plain(&j->from, &j->to, other->r, other->p, NULL, NULL, err));
  EP_TRY(ep_match_plain(&j->to, &j->from, back, other->back, NULL, NULL, err));
  other->cycle = ep_match_cycle(&j->from, other->p, other->back);
  other->rounds = best->rounds;
  other->plain = true;
  if (other->cycle < best->cycle) {
    const ep_trial old = *best;
    *best = *other;
    *other = old;
  }
  return EP_OK;
}

static ep_status match_once(job *j, ep_trial *t, ep_error *err) {
  const ep_match_rule rule = rule_of(j);
  EP_TRY(choose_frame(j, &rule, err));
  const ep_frame_candidate *chosen = &j->candidates.frame[j->candidates.chosen];
  memcpy(t->r, chosen->rotation, sizeof t->r);
  t->plain = false;
  ep_trial_free(&j->other);
  if (j->from.n > MATCH_SAMPLES || j->to.n > MATCH_SAMPLES) {
    EP_TRY(match_samples(j, &rule, t, err));
    EP_TRY(extend(j, &rule, t, err));
  } else {
    EP_TRY(ep_trial_run(&j->from, &j->to, &rule, REFRAME_ROUNDS, t, err));
  }
  t->rounds += chosen->rounds;
  // Plain neighbours know nothing of landmarks. Regions may be in wrong order: then they help.
  if (t->cycle > CYCLE_FALLBACK && !j->options->landmarks) EP_TRY(try_plain(j, t, &j->other, err));
  return EP_OK;
}

// Round trip as ep_match_cycle, through the points in tets: without the noise of vertices.
static double fine_cycle(const job *j, const int *back, const int *tet, const double *weight) {
  const ep_side *from = &j->from;
  double sum = 0;
  for (int i = 0; i < from->n; i++) {
    const int *corner = j->to.shape->mesh->tet + 4 * (size_t)tet[i];
    double d2 = 0;
    for (int c = 0; c < 3; c++) {
      double d = -from->x[3 * (size_t)i + c];
      for (int k = 0; k < 4; k++)
        d += weight[4 * (size_t)i + k] * from->x[3 * (size_t)back[corner[k]] + c];
      d2 += d * d;
    }
    sum += from->share[i] * d2;
  }
  return sqrt(sum) / from->radius;
}

// Vertices to points in tets: last, because regions in wrong order pull a map farther with every
// round.
static ep_status make_finer(const job *j, ep_trial *t, int *tet, double *weight, ep_error *err) {
  ep_match_rule rule = rule_of(j);
  rule.refine = true;
  if (j->options->same_family && rule.k < j->from.k) {
    rule.first = rule.k + FINE_STEP < j->from.k ? rule.k + FINE_STEP : j->from.k;
    rule.step = FINE_STEP;
    rule.k = j->from.k;
  }
  if (t->plain)
    EP_TRY(ep_match_plain(&j->from, &j->to, t->r, t->p, tet, weight, err));
  else
    EP_TRY(ep_match_levels(&j->from, &j->to, t->r, &rule, t->p, tet, weight, err));
  t->cycle = fine_cycle(j, t->back, tet, weight);
  return EP_OK;
}

// The candidates into the record.
static ep_status record_candidates(const job *j, ep_map_quality *q, ep_error *err) {
  const ep_candidates *c = &j->candidates;
  q->candidate = malloc((size_t)c->count * sizeof *q->candidate);
  if (!q->candidate) return ep_fail(err, EP_ERR_MEMORY, "no memory for a record");
  memcpy(q->candidate, c->frame, (size_t)c->count * sizeof *q->candidate);
  q->candidates = c->count;
  q->rivals = c->rivals;
  q->against = c->against;
  q->exchanged = c->exchanged[0];
  q->exchanged_with = c->exchanged[1];
  q->settle_from = c->settle_from;
  q->settle_to = c->settle_to;
  q->settle_other = c->settle_other;
  q->landmarks = j->options->landmarks;
  if (!q->landmarks) return EP_OK;
  q->landmark = malloc((size_t)q->landmarks * sizeof *q->landmark);
  if (!q->landmark) return ep_fail(err, EP_ERR_MEMORY, "no memory for a record");
  memcpy(q->landmark, j->held, (size_t)q->landmarks * sizeof *q->landmark);
  return EP_OK;
}

// Take regions out that the map contradicts. *dropped: how many; none where it would be half of
// them or more: then the map is as likely wrong as the file.
static ep_status drop_suspects(job *j, const ep_trial *t, int *dropped, ep_error *err) {
  const int count = j->from.regions;
  double *overlap = malloc((size_t)count * count * sizeof *overlap);
  unsigned char *suspect = malloc((size_t)count);
  int *best = malloc((size_t)count * sizeof *best);
  ep_status status = overlap && suspect && best
                         ? ep_region_overlap(&j->from, &j->to, t->p, overlap, err)
                         : ep_fail(err, EP_ERR_MEMORY, "no memory for %d regions", count);
  int out = 0, fresh = 0;
  if (status == EP_OK) {
    ep_region_suspects(count, overlap, j->use, suspect, best);
    for (int g = 0; g < count; g++) {
      out += suspect[g];
      fresh += suspect[g] && j->use[g];
    }
    *dropped = 2 * out < count ? fresh : 0;
    for (int g = 0; g < count && *dropped; g++)
      if (suspect[g]) j->use[g] = 0;
  }
  free(overlap);
  free(suspect);
  free(best);
  return status;
}

static ep_status match_and_drop(job *j, ep_trial *t, ep_error *err) {
  EP_TRY(match_once(j, t, err));
  for (int round = 0; j->use && round < DROP_ROUNDS; round++) {
    int dropped = 0;
    EP_TRY(drop_suspects(j, t, &dropped, err));
    if (!dropped) break;
    EP_TRY(match_once(j, t, err));
  }
  return EP_OK;
}

static ep_status functional_map(const job *j, ep_map *out, ep_error *err) {
  const int m = out->m, k = j->from.k;
  double *full = malloc((size_t)k * k * sizeof *full);
  if (!full) return ep_fail(err, EP_ERR_MEMORY, "no memory for a functional map");
  ep_status status = ep_match_functional(&j->from, &j->to, out->p, full, err);
  for (int a = 0; a < m && status == EP_OK; a++)
    for (int b = 0; b < m; b++) {
      out->c[a * m + b] = full[a * k + b];
      out->a[b * m + a] = full[a * k + b];
    }
  free(full);
  return status == EP_OK ? ep_polar(m, m, out->a, out->a, err) : status;
}

// How far the map takes the landmarks (the vertices nearest to them) from their partners: rms over
// the rms radius of `to`; 0 without landmarks.
static double landmark_residual(const job *j, const ep_map *map) {
  const ep_side *to = &j->to;
  double sum = 0;
  for (int m = 0; m < to->marks; m++) {
    const int v = j->from.mark_near[m];
    const int *tet = to->shape->mesh->tet + 4 * (size_t)map->tet[v];
    for (int c = 0; c < 3; c++) {
      double image = 0;
      for (int i = 0; i < 4; i++)
        image += map->weight[4 * (size_t)v + i] * to->x[3 * (size_t)tet[i] + c];
      sum += (image - to->mark_x[3 * m + c]) * (image - to->mark_x[3 * m + c]);
    }
  }
  return to->marks ? sqrt(sum / to->marks) / to->radius : 0;
}

// A trial made as fine as it gets.
typedef struct fine_map {
  ep_point_map there, back;
  double handed; // before the elastic refinement, which would hide what matching mixed up
  ep_elastic_quality elastic;
} fine_map;

static void free_fine(fine_map *f) {
  ep_point_map_free(&f->there);
  ep_point_map_free(&f->back);
}

// Regions in use that the map agrees with, into use (regions): others would pull it farther with
// every round.
static ep_status agreeing_regions(const job *j, const int *p, unsigned char *use, ep_error *err) {
  const int count = j->from.regions;
  double *overlap = malloc((size_t)count * count * sizeof *overlap);
  int *best = malloc((size_t)count * sizeof *best);
  ep_status status = overlap && best
                         ? ep_region_overlap(&j->from, &j->to, p, overlap, err)
                         : ep_fail(err, EP_ERR_MEMORY, "no memory for %d regions", count);
  if (status == EP_OK) ep_region_suspects(count, overlap, j->use, use, best);
  for (int g = 0; g < count && status == EP_OK; g++) use[g] = j->use[g] && !use[g];
  free(overlap);
  free(best);
  return status;
}

static ep_status refine_elastically(const job *j, const ep_trial *t, fine_map *out, ep_error *err) {
  ep_match_rule rule = rule_of(j);
  unsigned char *use = NULL;
  ep_status status = EP_OK;
  if (j->use) {
    use = malloc((size_t)j->from.regions);
    status = use ? agreeing_regions(j, t->p, use, err)
                 : ep_fail(err, EP_ERR_MEMORY, "no memory for %d regions", j->from.regions);
    rule.use = use;
    rule.region_weight *= REGION_SHARE;
  }
  if (status == EP_OK)
    status = ep_elastic_refine(&j->from, &j->to, t->r, &rule, &out->there, &out->back,
                               &out->elastic, err);
  free(use);
  return status;
}

static ep_status refine(const job *j, ep_trial *t, fine_map *out, ep_error *err) {
  const ep_side *from = &j->from, *to = &j->to;
  EP_TRY(ep_point_map_make(from->n, &out->there, err));
  EP_TRY(ep_point_map_make(to->n, &out->back, err));
  EP_TRY(make_finer(j, t, out->there.tet, out->there.weight, err));
  memcpy(out->there.p, t->p, (size_t)from->n * sizeof *t->p);
  memcpy(out->back.p, t->back, (size_t)to->n * sizeof *t->back);
  EP_TRY(ep_point_map_from_vertices(to->n, from->shape->mesh, &out->back, err));
  EP_TRY(ep_map_handedness(from, to, t->r, &out->there, &out->handed, err));
  return refine_elastically(j, t, out, err);
}

// The trial, or the other one where there is one and its refined map has the lower energy. The
// record tells of the one kept, but for the round trip: the shorter of the two is what the
// verdict's limits were measured with. The kept one's own separates nothing more (of plane, bird
// and fish right maps with regions .43 to .49, wrong ones .37 to .49) and would make five right
// maps doubtful and two bad.
static ep_status refine_best(job *j, ep_trial *t, fine_map *out, ep_map_quality *q, ep_error *err) {
  fine_map second = {0};
  EP_TRY(refine(j, t, out, err));
  q->energy_other = -1;
  if (j->other.p) {
    const ep_status status = refine(j, &j->other, &second, err);
    if (status == EP_OK && second.elastic.energy < out->elastic.energy) {
      const fine_map first = *out;
      const ep_trial old = *t;
      *out = second;
      second = first;
      *t = j->other;
      j->other = old;
    }
    q->energy_other = second.elastic.energy;
    free_fine(&second);
    EP_TRY(status);
  }
  q->cycle = j->other.p ? fmin(t->cycle, j->other.cycle) : t->cycle;
  q->handed = out->handed;
  q->from_nearest = t->plain;
  q->energy = out->elastic.energy;
  q->distortion = out->elastic.distortion;
  return EP_OK;
}

static ep_status finish(job *j, ep_trial *t, ep_map *out, ep_error *err) {
  const size_t square = (size_t)j->options->m * j->options->m;
  fine_map fine = {0};
  out->n = j->from.n;
  out->m = j->options->m;
  out->quality.inverted = out->quality.inverted_left = -1;
  out->c = malloc(square * sizeof *out->c);
  out->a = malloc(square * sizeof *out->a);
  ep_status status = out->c && out->a ? refine_best(j, t, &fine, &out->quality, err)
                                      : ep_fail(err, EP_ERR_MEMORY, "no memory for a map");
  out->p = fine.there.p;
  out->tet = fine.there.tet;
  out->weight = fine.there.weight;
  ep_point_map_free(&fine.back);
  EP_TRY(status);
  EP_TRY(record_candidates(j, &out->quality, err));
  out->quality.landmark_residual = landmark_residual(j, out);
  EP_TRY(functional_map(j, out, err));
  memcpy(out->rotation, t->r, sizeof t->r);
  out->scale = j->from.length / j->to.length;
  memcpy(out->center_from, j->from.centre, sizeof out->center_from);
  memcpy(out->center_to, j->to.centre, sizeof out->center_to);
  out->quality.reframe_rounds = t->rounds;
  out->quality.frame_angle = ep_frame_angle(t->r);
  return ep_map_judge(&j->from, &j->to, j->use, j->options->same_family, out, err);
}

static ep_status check_shapes(const ep_shape *from, const ep_shape *to, const ep_map_options *o,
                              ep_error *err) {
  const char *a = from->mesh->name, *b = to->mesh->name;
  const int fewer = from->lb->m < to->lb->m ? from->lb->m : to->lb->m;
  if (o->m < 1 || o->m > fewer)
    return ep_fail(err, EP_ERR_ARGUMENT,
                   "a map of %d eigenfunctions between %s and %s, which have %d and %d; ask for at "
                   "most %d",
                   o->m, a, b, from->lb->m, to->lb->m, fewer);
  if (o->landmarks < 0 || o->landmarks > EP_LANDMARKS_MAX)
    return ep_fail(err, EP_ERR_ARGUMENT, "%d landmarks; at most %d are taken", o->landmarks,
                   EP_LANDMARKS_MAX);
  const ep_regions *r = o->regions;
  if (r && (o->from_column < 0 || o->from_column >= r->shapes || o->to_column < 0 ||
            o->to_column >= r->shapes))
    return ep_fail(err, EP_ERR_ARGUMENT, "columns %d and %d of regions for %d shapes",
                   o->from_column, o->to_column, r->shapes);
  const int parts_a = ep_components(from->mesh), parts_b = ep_components(to->mesh);
  if (parts_a < 0 || parts_b < 0) return ep_fail(err, EP_ERR_MEMORY, "no memory to map %s", a);
  if (parts_a != parts_b)
    return ep_fail(err, EP_ERR_MATCH,
                   "%s has %d connected part(s) and %s has %d: they cannot be mapped; join the "
                   "parts or remove the extra ones",
                   a, parts_a, b, parts_b);
  return EP_OK;
}

// Functions both sides can offer, as many as the recipe wants.
static int functions_in_use(const ep_shape *from, const ep_shape *to, const ep_map_options *o) {
  int k = o->same_family ? EP_MAP_SPACE_FAMILY : FUNCTIONS_SHAPES;
  if (k < o->m) k = o->m;
  if (k > from->lb->m) k = from->lb->m;
  return k > to->lb->m ? to->lb->m : k;
}

static ep_status make_job(const ep_shape *from, const ep_shape *to, job *j, ep_error *err) {
  const ep_map_options *o = j->options;
  const int k = functions_in_use(from, to, o);
  EP_TRY(ep_side_make(from, k, &j->from, err));
  EP_TRY(ep_side_make(to, k, &j->to, err));
  if (o->landmarks) {
    EP_TRY(ep_side_landmarks(&j->from, o->landmarks, o->landmark, true, err));
    EP_TRY(ep_side_landmarks(&j->to, o->landmarks, o->landmark, false, err));
  }
  if (!o->regions) return EP_OK;
  EP_TRY(ep_side_regions(&j->from, o->regions, o->from_column, err));
  EP_TRY(ep_side_regions(&j->to, o->regions, o->to_column, err));
  j->use = malloc((size_t)o->regions->count);
  if (!j->use) return ep_fail(err, EP_ERR_MEMORY, "no memory for %d regions", o->regions->count);
  memset(j->use, 1, (size_t)o->regions->count);
  return EP_OK;
}

// Regions left out are in the record; the caller, who knows the file, names them.
static void say(const job *j, const ep_map *map) {
  const ep_map_quality *q = &map->quality;
  if (q->regions && q->coupled_functions < map->m)
    ep_notice(j->log, "%d regions alone determine %d of %d functions: positions do the rest",
              q->regions, q->coupled_functions, map->m);
  if (q->verdict != EP_MAP_GOOD)
    ep_warn(j->log, "map %s <- %s is %s: %s", j->from.shape->mesh->name, j->to.shape->mesh->name,
            q->verdict == EP_MAP_BAD ? "bad" : "doubtful", q->reasons);
}

ep_status ep_map_match(const ep_shape *from, const ep_shape *to, const ep_map_options *options,
                       ep_log *log, ep_map *out, ep_error *err) {
  memset(out, 0, sizeof *out);
  EP_TRY(check_shapes(from, to, options, err));
  job j = {.options = options, .log = log};
  ep_trial t = {0};
  ep_status status = make_job(from, to, &j, err);
  if (status == EP_OK) status = ep_trial_make(&j.from, &j.to, &t, err);
  if (status == EP_OK) status = match_and_drop(&j, &t, err);
  if (status == EP_OK) status = finish(&j, &t, out, err);
  if (status == EP_OK) say(&j, out);
  if (status != EP_OK) {
    ep_map_free(out);
    ep_fail_context(err, "map %s <- %s", from->mesh->name, to->mesh->name);
  }
  ep_trial_free(&t);
  ep_trial_free(&j.other);
  free(j.use);
  ep_candidates_free(&j.candidates);
  ep_side_free(&j.from);
  ep_side_free(&j.to);
  return status;
}
