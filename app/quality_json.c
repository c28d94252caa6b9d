#include "app/quality_json.h"

#include "app/report.h"

const char *ep_verdict_name(ep_verdict verdict) {
  return verdict == EP_MAP_GOOD ? "good" : verdict == EP_MAP_DOUBTFUL ? "doubtful" : "bad";
}

static json_t *region_json(int index, const ep_region_quality *r) {
  json_t *object = json_object();
  if (!object) return NULL;
  json_object_set_new(object, "region", json_integer(index + 1));
  json_object_set_new(object, "residual_before", ep_json_number(r->residual_before));
  json_object_set_new(object, "residual_after", ep_json_number(r->residual_after));
  json_object_set_new(object, "jaccard", ep_json_number(r->jaccard));
  json_object_set_new(object, "best_match", json_integer(r->best_match + 1));
  json_object_set_new(object, "suspect", json_boolean(r->suspect));
  return object;
}

json_t *ep_quality_json(const ep_map_quality *q) {
  json_t *object = json_object(), *regions = json_array();
  if (!object || !regions) {
    json_decref(object);
    json_decref(regions);
    return NULL;
  }
  const struct {
    const char *key;
    double value;
  } numbers[] = {
      {"residual_before", q->residual_before},
      {"residual_after", q->residual_after},
      {"orthogonality", q->orthogonality},
      {"determinant", q->determinant},
      {"coverage", q->coverage},
      {"cycle", q->cycle},
      {"dirichlet", q->dirichlet},
      {"frame_angle", q->frame_angle},
  };
  json_object_set_new(object, "verdict", json_string(ep_verdict_name(q->verdict)));
  json_object_set_new(object, "reasons", json_string(q->reasons));
  for (size_t i = 0; i < sizeof numbers / sizeof *numbers; i++)
    json_object_set_new(object, numbers[i].key, ep_json_number(numbers[i].value));
  json_object_set_new(object, "near_multiple", json_integer(q->near_multiple));
  json_object_set_new(object, "reframe_rounds", json_integer(q->reframe_rounds));
  for (int i = 0; q->region && i < q->regions; i++)
    json_array_append_new(regions, region_json(i, &q->region[i]));
  json_object_set_new(object, "regions", regions);
  return object;
}

void ep_quality_text(FILE *out, const char *name, const ep_map_quality *q) {
  fprintf(out, "%s: %s%s%s\n", name, ep_verdict_name(q->verdict), q->reasons[0] ? ": " : "",
          q->reasons);
  fprintf(out, "  coverage %.3f, round trip %.3f, Dirichlet %.3f, frame turned by %.1f degrees\n",
          q->coverage, q->cycle, q->dirichlet, q->frame_angle);
  if (!q->region || !q->regions) return;
  fprintf(out, "  regions: residual %.3f before, %.3f after\n", q->residual_before,
          q->residual_after);
  fprintf(out, "  %6s %8s %8s %8s %6s\n", "region", "before", "after", "Jaccard", "best");
  for (int i = 0; i < q->regions; i++) {
    const ep_region_quality *r = &q->region[i];
    fprintf(out, "  %6d %8.3f %8.3f %8.3f %6d%s\n", i + 1, r->residual_before, r->residual_after,
            r->jaccard, r->best_match + 1, r->suspect ? "  suspect" : "");
  }
}

json_t *ep_pose_json(const ep_pose_quality *q) {
  json_t *object = json_object();
  const struct {
    const char *key;
    double value;
  } numbers[] = {
      {"inverted_tets", q->inverted_tets},
      {"inverted_before_repair", q->inverted_before},
      {"crushed_tets", q->crushed_tets},
      {"crushed_before_repair", q->crushed_before},
      {"worst_volume_ratio", q->worst_volume_ratio},
      {"worst_volume_ratio_before_repair", q->worst_before},
      {"repair_moved", q->repair_moved},
      {"repair_moved_most", q->repair_moved_most},
      {"repair_coefficient_shift", q->repair_shift},
      {"coefficient_error", q->coefficient_error},
      {"fixed_shift", q->fixed_shift},
      {"iterations", q->iterations},
  };
  for (size_t i = 0; object && i < sizeof numbers / sizeof *numbers; i++)
    json_object_set_new(object, numbers[i].key, ep_json_number(numbers[i].value));
  return object;
}

void ep_pose_text(FILE *out, const char *name, const ep_pose_quality *q) {
  fprintf(out, "pose %s: %.0f inverted tets (%.0f before repair), smallest volume %.3f of rest\n",
          name, q->inverted_tets, q->inverted_before, q->worst_volume_ratio);
  if (q->crushed_before > 0)
    fprintf(out,
            "  repair moved vertices by %.1e of the diagonal (rms, %.1e at most), the low "
            "coefficients by %.1e\n",
            q->repair_moved, q->repair_moved_most, q->repair_shift);
}
