#include "app/bake/map_store.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

// The numbers of a record in the order they are stored; reasons, regions and candidates apart.
#define QUALITY_FIELDS(X)                                                                          \
  X(verdict)                                                                                       \
  X(residual_before)                                                                               \
  X(residual_after)                                                                                \
  X(orthogonality)                                                                                 \
  X(determinant)                                                                                   \
  X(coverage)                                                                                      \
  X(cycle)                                                                                         \
  X(handed)                                                                                        \
  X(energy)                                                                                        \
  X(energy_other)                                                                                  \
  X(distortion)                                                                                    \
  X(from_nearest)                                                                                  \
  X(dirichlet)                                                                                     \
  X(near_multiple)                                                                                 \
  X(reframe_rounds)                                                                                \
  X(frame_angle)                                                                                   \
  X(regions)                                                                                       \
  X(coupled_functions)                                                                             \
  X(coupling_k)                                                                                    \
  X(coupling_mu)                                                                                   \
  X(held_out)                                                                                      \
  X(landmarks)                                                                                     \
  X(landmark_residual)                                                                             \
  X(candidates)                                                                                    \
  X(rivals)                                                                                        \
  X(against)                                                                                       \
  X(exchanged)                                                                                     \
  X(exchanged_with)                                                                                \
  X(settle_from)                                                                                   \
  X(settle_to)                                                                                     \
  X(settle_other)                                                                                  \
  X(inverted)                                                                                      \
  X(inverted_left)
#define REGION_FIELDS(X) X(residual_before) X(residual_after) X(jaccard) X(best_match) X(suspect)
#define CANDIDATE_FIELDS(X)                                                                        \
  X(reflected)                                                                                     \
  X(start_angle) X(score) X(distance) X(cycle) X(landmark) X(chosen) X(rival) X(alone) X(against)
#define LANDMARK_FIELDS(X) X(held_out) X(best_match)

#define COUNT(field) +1
#define PACK(field)  numbers[i++] = (double)record->field;
enum {
  QUALITY_NUMBERS = 0 QUALITY_FIELDS(COUNT),
  REGION_NUMBERS = 0 REGION_FIELDS(COUNT),
  CANDIDATE_NUMBERS = 9 CANDIDATE_FIELDS(COUNT), // the rotation first
  LANDMARK_NUMBERS = 0 LANDMARK_FIELDS(COUNT),
  FRAME_NUMBERS = 7,
  NAME = sizeof((ep_frame_candidate *)0)->name,
  REASONS = sizeof((ep_map_quality *)0)->reasons,
  RECORDS_MAX = 100000
};
#define UNPACK(field) record->field = (__typeof__(record->field))numbers[i++];

static void pack_quality(const ep_map_quality *record, double *numbers) {
  int i = 0;
  QUALITY_FIELDS(PACK)
}
static void unpack_quality(const double *numbers, ep_map_quality *record) {
  int i = 0;
  QUALITY_FIELDS(UNPACK)
}
static void pack_region(const ep_region_quality *record, double *numbers) {
  int i = 0;
  REGION_FIELDS(PACK)
}
static void unpack_region(const double *numbers, ep_region_quality *record) {
  int i = 0;
  REGION_FIELDS(UNPACK)
}
static void pack_landmark(const ep_landmark_quality *record, double *numbers) {
  int i = 0;
  LANDMARK_FIELDS(PACK)
}
static void unpack_landmark(const double *numbers, ep_landmark_quality *record) {
  int i = 0;
  LANDMARK_FIELDS(UNPACK)
}
static void pack_candidate(const ep_frame_candidate *record, double *numbers) {
  int i = 9;
  memcpy(numbers, record->rotation, sizeof record->rotation);
  CANDIDATE_FIELDS(PACK)
}
static void unpack_candidate(const double *numbers, ep_frame_candidate *record) {
  int i = 9;
  memcpy(record->rotation, numbers, sizeof record->rotation);
  CANDIDATE_FIELDS(UNPACK)
}

// ---- store -----------------------------------------------------------------------------------

// What of a map must be copied before it can be stored.
typedef struct packed {
  double quality[QUALITY_NUMBERS], frame[FRAME_NUMBERS];
  char reasons[REASONS];
  double *regions, *candidates, *landmarks;
  char *names;
} packed;

static ep_status pack(const ep_map *map, packed *p, ep_error *err) {
  const ep_map_quality *q = &map->quality;
  p->regions = calloc((size_t)q->regions * REGION_NUMBERS + 1, sizeof *p->regions);
  p->candidates = calloc((size_t)q->candidates * CANDIDATE_NUMBERS + 1, sizeof *p->candidates);
  p->names = calloc((size_t)q->candidates + 1, NAME);
  p->landmarks = calloc((size_t)q->landmarks * LANDMARK_NUMBERS + 1, sizeof *p->landmarks);
  if (!p->regions || !p->candidates || !p->names || !p->landmarks)
    return ep_fail(err, EP_ERR_MEMORY, "no memory to store a map");
  pack_quality(q, p->quality);
  for (int i = 0; i < q->regions; i++) pack_region(&q->region[i], p->regions + REGION_NUMBERS * i);
  for (int i = 0; i < q->candidates; i++) {
    pack_candidate(&q->candidate[i], p->candidates + CANDIDATE_NUMBERS * i);
    snprintf(p->names + NAME * i, NAME, "%s", q->candidate[i].name);
  }
  for (int i = 0; q->landmark && i < q->landmarks; i++)
    pack_landmark(&q->landmark[i], p->landmarks + LANDMARK_NUMBERS * i);
  snprintf(p->reasons, sizeof p->reasons, "%s", q->reasons);
  p->frame[0] = map->scale;
  memcpy(p->frame + 1, map->center_from, sizeof map->center_from);
  memcpy(p->frame + 4, map->center_to, sizeof map->center_to);
  return EP_OK;
}

static ep_status store(const ep_cache *cache, const char *stage, const ep_digest *key,
                       const ep_map *map, const packed *p, ep_error *err) {
  const ep_map_quality *q = &map->quality;
  ep_tensor tensors[13] = {
      ep_tensor_of("p", EP_I32, map->p, map->n, 0, 0),
      ep_tensor_of("tet", EP_I32, map->tet, map->n, 0, 0),
      ep_tensor_of("weight", EP_F64, map->weight, map->n, 4, 0),
      ep_tensor_of("c", EP_F64, map->c, map->m, map->m, 0),
      ep_tensor_of("a", EP_F64, map->a, map->m, map->m, 0),
      ep_tensor_of("rotation", EP_F64, map->rotation, 9, 0, 0),
      ep_tensor_of("frame", EP_F64, p->frame, FRAME_NUMBERS, 0, 0),
      ep_tensor_of("quality", EP_F64, p->quality, QUALITY_NUMBERS, 0, 0),
      ep_tensor_of("reasons", EP_U8, p->reasons, REASONS, 0, 0),
  };
  int count = 9;
  if (q->regions)
    tensors[count++] = ep_tensor_of("regions", EP_F64, p->regions, q->regions, REGION_NUMBERS, 0);
  if (q->landmark)
    tensors[count++] =
        ep_tensor_of("landmarks", EP_F64, p->landmarks, q->landmarks, LANDMARK_NUMBERS, 0);
  if (q->candidates) {
    tensors[count++] =
        ep_tensor_of("candidates", EP_F64, p->candidates, q->candidates, CANDIDATE_NUMBERS, 0);
    tensors[count++] = ep_tensor_of("names", EP_U8, p->names, q->candidates, NAME, 0);
  }
  return ep_cache_store(cache, stage, key, count, tensors, 0, NULL, err);
}

ep_status ep_map_store(const ep_cache *cache, const char *stage, const ep_digest *key,
                       const ep_map *map, ep_error *err) {
  packed p = {0};
  ep_status status = pack(map, &p, err);
  if (status == EP_OK) status = store(cache, stage, key, map, &p, err);
  free(p.regions);
  free(p.candidates);
  free(p.names);
  free(p.landmarks);
  return status;
}

// ---- take ------------------------------------------------------------------------------------

static void *copy(const void *found, size_t bytes) {
  void *out = found ? malloc(bytes + 1) : NULL;
  if (out) memcpy(out, found, bytes);
  return out;
}

static bool take_regions(const ep_artifact *artifact, ep_map_quality *q) {
  const size_t count = (size_t)q->regions;
  if (!count) return true;
  const double *numbers = ep_artifact_array(artifact, "regions", EP_F64, count * REGION_NUMBERS);
  q->region = numbers ? calloc(count, sizeof *q->region) : NULL;
  for (size_t i = 0; q->region && i < count; i++)
    unpack_region(numbers + REGION_NUMBERS * i, &q->region[i]);
  return q->region != NULL;
}

static bool take_candidates(const ep_artifact *artifact, ep_map_quality *q) {
  const size_t count = (size_t)q->candidates;
  if (!count) return true;
  const double *numbers =
      ep_artifact_array(artifact, "candidates", EP_F64, count * CANDIDATE_NUMBERS);
  const char *names = ep_artifact_array(artifact, "names", EP_U8, count * NAME);
  q->candidate = numbers && names ? calloc(count, sizeof *q->candidate) : NULL;
  for (size_t i = 0; q->candidate && i < count; i++) {
    unpack_candidate(numbers + CANDIDATE_NUMBERS * i, &q->candidate[i]);
    memcpy(q->candidate[i].name, names + NAME * i, NAME - 1);
  }
  return q->candidate != NULL;
}

static bool take_landmarks(const ep_artifact *artifact, ep_map_quality *q) {
  const size_t count = (size_t)q->landmarks;
  if (!count) return true;
  const double *numbers =
      ep_artifact_array(artifact, "landmarks", EP_F64, count * LANDMARK_NUMBERS);
  q->landmark = numbers ? calloc(count, sizeof *q->landmark) : NULL;
  bool good = q->landmark != NULL;
  for (size_t i = 0; good && i < count; i++) {
    unpack_landmark(numbers + LANDMARK_NUMBERS * i, &q->landmark[i]);
    good = q->landmark[i].best_match >= 0 && q->landmark[i].best_match < q->landmarks;
  }
  return good;
}

static bool take_quality(const ep_artifact *artifact, ep_map_quality *q) {
  const double *numbers = ep_artifact_array(artifact, "quality", EP_F64, QUALITY_NUMBERS);
  const char *reasons = ep_artifact_array(artifact, "reasons", EP_U8, REASONS);
  if (!numbers || !reasons) return false;
  unpack_quality(numbers, q);
  memcpy(q->reasons, reasons, REASONS - 1);
  const bool sane = q->regions >= 0 && q->regions < RECORDS_MAX && q->candidates >= 0 &&
                    q->candidates < RECORDS_MAX && q->landmarks >= 0 &&
                    q->landmarks <= EP_LANDMARKS_MAX;
  if (sane && take_regions(artifact, q) && take_candidates(artifact, q) &&
      take_landmarks(artifact, q))
    return true;
  if (!q->region) q->regions = 0;
  if (!q->candidate) q->candidates = 0;
  if (!q->landmark) q->landmarks = 0;
  return false;
}

static bool take_points(const ep_artifact *artifact, const ep_mesh *to, ep_map *map) {
  const size_t n = (size_t)map->n;
  map->p = copy(ep_artifact_array(artifact, "p", EP_I32, n), n * sizeof *map->p);
  map->tet = copy(ep_artifact_array(artifact, "tet", EP_I32, n), n * sizeof *map->tet);
  map->weight =
      copy(ep_artifact_array(artifact, "weight", EP_F64, 4 * n), 4 * n * sizeof *map->weight);
  bool good = map->p && map->tet && map->weight;
  for (size_t v = 0; good && v < n; v++)
    good = map->p[v] >= 0 && map->p[v] < to->nv && map->tet[v] >= 0 && map->tet[v] < to->nt;
  return good;
}

bool ep_map_take(const ep_artifact *artifact, int n, int m, const ep_mesh *to, ep_map *map) {
  const size_t square = (size_t)m * (size_t)m;
  const double *rotation = ep_artifact_array(artifact, "rotation", EP_F64, 9);
  const double *frame = ep_artifact_array(artifact, "frame", EP_F64, FRAME_NUMBERS);
  *map = (ep_map){.n = n, .m = m};
  map->c = copy(ep_artifact_array(artifact, "c", EP_F64, square), square * sizeof *map->c);
  map->a = copy(ep_artifact_array(artifact, "a", EP_F64, square), square * sizeof *map->a);
  if (!rotation || !frame || !map->c || !map->a || !take_points(artifact, to, map) ||
      !take_quality(artifact, &map->quality)) {
    ep_map_free(map);
    return false;
  }
  memcpy(map->rotation, rotation, sizeof map->rotation);
  map->scale = frame[0];
  memcpy(map->center_from, frame + 1, sizeof map->center_from);
  memcpy(map->center_to, frame + 4, sizeof map->center_to);
  return true;
}
