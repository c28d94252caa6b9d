// The verdict on a map, and its reasons, from what the record holds.
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "align/private.h"

// Thresholds from bench_verdict: 413 maps of known truth between 19 pairs of shapes, with
// nothing, sensible and wrong landmarks and regions, and turned examples (docs/maps.md).
// Round trip: right maps with nothing given <= .25 but for plane to fish (.35) and bird to fish
// (.52); with landmarks or regions <= .38 (bird to fish with regions .46); one landmark far off
// >= .48.
static const double CYCLE_DOUBTFUL = 0.3, CYCLE_GUIDED = 0.4, CYCLE_BAD = 0.6;
enum { GUIDING_LANDMARKS = 5, GUIDING_REGIONS = 4 };
// Left and right kept: right maps between shapes >= .83, between poses of one family >= .90 (a
// squatting gorilla; the others .98); two landmarks exchanged <= .86, all of them mostly <= .3.
static const double HANDED_DOUBTFUL = 0.72, HANDED_DOUBTFUL_FAMILY = 0.86, HANDED_BAD = 0.25;
// Jaccard: usable maps had .64 and more, failed ones .37-.43.
static const double JACCARD_DOUBTFUL = 0.5, JACCARD_BAD = 0.3;
// Coverage: a map that leaves a third of the example out misses a limb. Right maps >= .70.
static const double COVERAGE_DOUBTFUL = 0.65, COVERAGE_BAD = 0.3;
// Poses of one family turn by up to 57 degrees: a larger turn may be wrong.
static const double FRAME_DOUBTFUL_FAMILY = 60;

enum { NUMBER = 32 };

// A measure and what is wanted of it, in as few digits, two and more, as tell them apart.
static void print_apart(double value, double limit, char text[2][NUMBER]) {
  for (int digits = 2; digits < 9; digits++) {
    snprintf(text[0], NUMBER, "%.*f", digits, value);
    snprintf(text[1], NUMBER, "%.*f", digits, limit);
    if (strcmp(text[0], text[1]) != 0) return;
  }
}

// One measure against its two thresholds; high: large values are bad.
static void weigh(ep_map_quality *q, const char *what, double value, double doubtful, double bad,
                  bool high, const char *advice) {
  const bool is_bad = high ? value > bad : value < bad;
  const bool is_doubtful = high ? value > doubtful : value < doubtful;
  if (!is_bad && !is_doubtful) return;
  const ep_verdict verdict = is_bad ? EP_MAP_BAD : EP_MAP_DOUBTFUL;
  if (verdict > q->verdict) q->verdict = verdict;
  const size_t used = strlen(q->reasons);
  char number[2][NUMBER];
  print_apart(value, doubtful, number);
  snprintf(q->reasons + used, sizeof q->reasons - used, "%s%s %s (%s %s wanted); %s",
           used ? "; " : "", what, number[0], high ? "at most" : "at least", number[1], advice);
}

static const char *file_name(const ep_mesh *mesh) {
  const char *slash = strrchr(mesh->name, '/');
  return slash ? slash + 1 : mesh->name;
}

// More than one frame fits: name them, and the landmark that tells them apart.
static void weigh_rivals(const ep_mesh *from, const ep_mesh *to, ep_map_quality *q) {
  if (!q->rivals) return;
  if (q->verdict == EP_MAP_GOOD) q->verdict = EP_MAP_DOUBTFUL;
  char *end = q->reasons + sizeof q->reasons, *at = q->reasons + strlen(q->reasons);
  const char *chosen = "";
  for (int i = 0; i < q->candidates; i++)
    if (q->candidate[i].chosen) chosen = q->candidate[i].name;
  at += snprintf(at, (size_t)(end - at), "%sframe '%s' was chosen, but",
                 at > q->reasons ? "; " : "", chosen);
  int named = 0;
  for (int i = 0; i < q->candidates && at < end - 64; i++)
    if (q->candidate[i].rival && named++ < 3)
      at += snprintf(at, (size_t)(end - at), "%s '%s'", named > 1 ? "," : "", q->candidate[i].name);
  if (at < end && q->rivals > 3)
    at += snprintf(at, (size_t)(end - at), " and %d more", q->rivals - 3);
  if (at < end)
    snprintf(at, (size_t)(end - at),
             " fit%s as well: nothing tells them apart. One landmark settles it: vertex %d of %s "
             "with vertex %d of %s, as mapped now, or with %d (numbers of the files, from 1); or "
             "give map: {frame: authored} where it is right",
             q->rivals > 1 ? "" : "s", from->file_vertex[q->settle_from] + 1, file_name(from),
             to->file_vertex[q->settle_to] + 1, file_name(to),
             to->file_vertex[q->settle_other] + 1);
}

// The shapes alone say something else than who chose the frame.
static void weigh_against(ep_map_quality *q) {
  if (!q->against) return;
  if (q->verdict == EP_MAP_GOOD) q->verdict = EP_MAP_DOUBTFUL;
  const ep_frame_candidate *best = NULL, *chosen = NULL;
  for (int i = 0; i < q->candidates; i++) {
    const ep_frame_candidate *f = &q->candidate[i];
    if (f->chosen) chosen = f;
    if (f->against && (!best || f->score < best->score)) best = f;
  }
  const size_t used = strlen(q->reasons);
  snprintf(q->reasons + used, sizeof q->reasons - used,
           "%sframe '%s' was chosen, but by the shapes alone '%s' fits %s: %s", used ? "; " : "",
           chosen->name, best->name,
           best->start_angle < 1 ? "at least as well, as the example stands" : "clearly better",
           q->landmarks ? "are landmarks exchanged, left with right?"
           : q->regions ? "are regions exchanged, left with right?"
                        : "turn the example as the object stands, or give landmarks");
}

static void weigh_inverted(ep_map_quality *q) {
  if (q->inverted_left <= 0) return;
  const size_t used = strlen(q->reasons);
  if (q->verdict == EP_MAP_GOOD) q->verdict = EP_MAP_DOUBTFUL;
  snprintf(q->reasons + used, sizeof q->reasons - used,
           "%s%d tet(s) of the transferred pose are inverted; use fewer eigenfunctions or a finer "
           "object",
           used ? "; " : "", q->inverted_left);
}

// Landmarks that the others contradict.
static void weigh_landmarks(ep_map_quality *q) {
  for (int m = 0; q->landmark && m < q->landmarks; m++) {
    const int best = q->landmark[m].best_match;
    const size_t used = strlen(q->reasons);
    if (best == m || used + 80 > sizeof q->reasons) continue;
    if (q->verdict == EP_MAP_GOOD) q->verdict = EP_MAP_DOUBTFUL;
    snprintf(q->reasons + used, sizeof q->reasons - used,
             "%slandmark %d, mapped by the others, belongs to the partner of landmark %d",
             used ? "; " : "", m + 1, best + 1);
  }
}

// Partners the shapes alone would give the other way round.
static void weigh_exchanged(ep_map_quality *q) {
  if (q->exchanged < 0) return;
  if (q->verdict == EP_MAP_GOOD) q->verdict = EP_MAP_DOUBTFUL;
  const size_t used = strlen(q->reasons);
  snprintf(q->reasons + used, sizeof q->reasons - used,
           "%s%s %d and %d seem exchanged: by the shapes alone each fits the other's partner",
           used ? "; " : "", q->landmarks ? "landmarks" : "regions", q->exchanged + 1,
           q->exchanged_with + 1);
}

// Half of the regions or more contradict the map.
static void weigh_agreement(ep_map_quality *q, int agree) {
  if (!q->regions || 2 * agree > q->regions) return;
  if (q->verdict == EP_MAP_GOOD) q->verdict = EP_MAP_DOUBTFUL;
  const size_t used = strlen(q->reasons);
  snprintf(q->reasons + used, sizeof q->reasons - used,
           "%s%d of %d regions agree with the map (more than half wanted): check their order",
           used ? "; " : "", agree, q->regions);
}

void ep_map_note_inverted(ep_map *map, int inverted, int left) {
  map->quality.inverted = inverted;
  map->quality.inverted_left = left;
  weigh_inverted(&map->quality);
}

// Landmarks and regions that agree with the map vouch for it: between shapes of different build it
// may then miss its way back by more.
static double cycle_wanted(const ep_map_quality *q) {
  int agree = 0;
  for (int g = 0; g < q->regions; g++) agree += !q->region[g].suspect;
  const bool regions = agree >= GUIDING_REGIONS && 2 * agree > q->regions;
  return q->landmarks >= GUIDING_LANDMARKS || regions ? CYCLE_GUIDED : CYCLE_DOUBTFUL;
}

void ep_map_verdict(const ep_mesh *from, const ep_mesh *to, bool same_family, ep_map *map) {
  ep_map_quality *q = &map->quality;
  q->verdict = EP_MAP_GOOD;
  q->reasons[0] = '\0';
  const char *give = q->regions ? "check the regions, give more" : "give regions";
  if (q->cycle >= 0) weigh(q, "round trip", q->cycle, cycle_wanted(q), CYCLE_BAD, true, give);
  weigh(q, "covered share", q->coverage, COVERAGE_DOUBTFUL, COVERAGE_BAD, false, give);
  weigh(q, "share that keeps left and right", q->handed,
        same_family ? HANDED_DOUBTFUL_FAMILY : HANDED_DOUBTFUL, HANDED_BAD, false,
        q->landmarks ? "check that no landmarks are exchanged"
        : q->regions ? "check that no regions are exchanged"
                     : "the map is folded or mirrored there; give landmarks or regions");
  if (!q->regions && !q->landmarks && same_family)
    weigh(q, "turn of the frame in degrees", q->frame_angle, FRAME_DOUBTFUL_FAMILY, HUGE_VAL, true,
          "turn the example as the object stands, or give regions");
  weigh_rivals(from, to, q);
  weigh_against(q);
  weigh_landmarks(q);
  weigh_exchanged(q);
  double jaccard = 0;
  int used = 0;
  for (int g = 0; g < q->regions; g++) {
    if (q->region[g].suspect) continue;
    jaccard += q->region[g].jaccard;
    used++;
  }
  weigh_agreement(q, used);
  if (used)
    weigh(q, "mean Jaccard of regions", jaccard / used, JACCARD_DOUBTFUL, JACCARD_BAD, false,
          "check the regions' order and the example's pose");
}
