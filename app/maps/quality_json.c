#include "app/maps/quality_json.h"

#include "app/report.h"

const char *ep_verdict_name(ep_verdict verdict) {
  return verdict == EP_MAP_GOOD ? "good" : verdict == EP_MAP_DOUBTFUL ? "doubtful" : "bad";
}

void ep_map_note(const ep_map_quality *q, int dots, char *note, size_t size) {
  const char *shown = !dots ? "" : q->landmarks ? "; dots: landmarks" : "; dot: this landmark";
  snprintf(note, size, "%s%s", *q->reasons ? q->reasons : "same colour where mapped", shown);
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

// The landmarks as the others see them; null where not tried.
static json_t *landmarks_json(const ep_map_quality *q) {
  json_t *list = json_array();
  for (int m = 0; list && q->landmark && m < q->landmarks; m++) {
    const ep_landmark_quality *l = &q->landmark[m];
    json_array_append_new(
        list, json_pack("{s:i, s:o, s:i, s:b}", "landmark", m + 1, "held_out",
                        l->held_out < 0 ? json_null() : ep_json_number(l->held_out), "best_match",
                        l->best_match + 1, "suspect", l->best_match != m));
  }
  return list;
}

// One frame that was tried.
static json_t *frame_json(const ep_frame_candidate *c) {
  json_t *object = json_object();
  if (!object) return NULL;
  json_object_set_new(object, "name", ep_json_text(c->name));
  json_object_set_new(object, "reflected", json_boolean(c->reflected));
  json_object_set_new(object, "start_angle", ep_json_number(c->start_angle));
  json_object_set_new(object, "score", ep_json_number(c->score));
  json_object_set_new(object, "distance", ep_json_number(c->distance));
  json_object_set_new(object, "cycle", ep_json_number(c->cycle));
  json_object_set_new(object, "landmark",
                      c->landmark < 0 ? json_null() : ep_json_number(c->landmark));
  json_object_set_new(object, "chosen", json_boolean(c->chosen));
  json_object_set_new(object, "rival", json_boolean(c->rival));
  json_object_set_new(object, "alone", json_boolean(c->alone));
  json_object_set_new(object, "against", json_boolean(c->against));
  json_object_set_new(object, "rotation", ep_json_numbers(9, c->rotation));
  return object;
}

static int file_number(const ep_mesh *mesh, int vertex) {
  return mesh->file_vertex[vertex] + 1;
}

// The landmark that would settle the choice of the frame, null where it is clear.
static json_t *settle_json(const ep_map_quality *q, const ep_mesh *from, const ep_mesh *to) {
  if (q->settle_from < 0 || q->settle_to < 0 || q->settle_other < 0) return json_null();
  return json_pack("{s:i, s:i, s:i}", "vertex", file_number(from, q->settle_from), "now_goes_to",
                   file_number(to, q->settle_to), "or_should_go_to",
                   file_number(to, q->settle_other));
}

static void set_numbers(json_t *object, const ep_map_quality *q) {
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
      {"handed", q->handed},
      {"energy", q->energy},
      {"distortion", q->distortion},
      {"dirichlet", q->dirichlet},
      {"frame_angle", q->frame_angle},
      {"landmark_residual", q->landmark_residual},
  };
  const struct {
    const char *key;
    int value;
  } counts[] = {
      {"near_multiple", q->near_multiple},
      {"reframe_rounds", q->reframe_rounds},
      {"landmarks", q->landmarks},
      {"rivals", q->rivals},
      {"against", q->against},
      {"inverted_tets", q->inverted_left},
      {"inverted_before_repair", q->inverted},
  };
  for (size_t i = 0; i < sizeof numbers / sizeof *numbers; i++)
    json_object_set_new(object, numbers[i].key, ep_json_number(numbers[i].value));
  json_object_set_new(object, "energy_other",
                      q->energy_other < 0 ? json_null() : ep_json_number(q->energy_other));
  json_object_set_new(object, "from_nearest", json_boolean(q->from_nearest));
  for (size_t i = 0; i < sizeof counts / sizeof *counts; i++) // -1: not told
    json_object_set_new(object, counts[i].key,
                        counts[i].value < 0 ? json_null() : json_integer(counts[i].value));
}

json_t *ep_quality_json(const ep_map_quality *q, const ep_mesh *from, const ep_mesh *to) {
  json_t *object = json_object(), *regions = json_array(), *frames = json_array();
  if (!object || !regions || !frames) {
    json_decref(object);
    json_decref(regions);
    json_decref(frames);
    return NULL;
  }
  json_object_set_new(object, "verdict", json_string(ep_verdict_name(q->verdict)));
  json_object_set_new(object, "reasons", ep_json_text(q->reasons));
  set_numbers(object, q);
  for (int i = 0; q->region && i < q->regions; i++)
    json_array_append_new(regions, region_json(i, &q->region[i]));
  for (int i = 0; q->candidate && i < q->candidates; i++)
    json_array_append_new(frames, frame_json(&q->candidate[i]));
  json_object_set_new(object, "regions", regions);
  json_object_set_new(object, "frames", frames);
  json_object_set_new(object, "landmarks_held_out", landmarks_json(q));
  json_object_set_new(object, "exchanged",
                      q->exchanged < 0
                          ? json_null()
                          : json_pack("[i, i]", q->exchanged + 1, q->exchanged_with + 1));
  json_object_set_new(object, "settle", settle_json(q, from, to));
  json_object_set_new(object, "coupling",
                      q->coupling_k > 0
                          ? json_pack("{s:i, s:i, s:o, s:o}", "functions", q->coupled_functions,
                                      "k", q->coupling_k, "mu", ep_json_number(q->coupling_mu),
                                      "held_out", ep_json_number(q->held_out))
                          : json_null());
  return object;
}

static void frames_text(FILE *out, const ep_map_quality *q, const ep_mesh *from,
                        const ep_mesh *to) {
  if (!q->candidate || q->candidates < 2) return;
  fprintf(out, "  %-32s %7s %9s %8s\n", "frame", "score", "distance", "cycle");
  for (int i = 0; i < q->candidates; i++) {
    const ep_frame_candidate *c = &q->candidate[i];
    if (c->alone && !c->against && !c->chosen)
      continue; // the record has them; they say nothing new
    fprintf(out, "  %-32s %7.3f %9.3f %8.3f%s\n", c->name, c->score, c->distance, c->cycle,
            c->chosen    ? "  chosen"
            : c->against ? "  by the shapes alone: contradicts the choice"
            : c->rival   ? "  could be as well"
                         : "");
  }
  if (q->settle_from >= 0 && q->settle_to >= 0 && q->settle_other >= 0)
    fprintf(
        out,
        "  a landmark would settle it: vertex %d with %d, as it is now, or with %d (numbers as in "
        "a scene, from 1)\n",
        file_number(from, q->settle_from), file_number(to, q->settle_to),
        file_number(to, q->settle_other));
}

static void landmarks_text(FILE *out, const ep_map_quality *q) {
  if (!q->landmarks) return;
  fprintf(out, "  %d landmarks, residual %.3f", q->landmarks, q->landmark_residual);
  for (int m = 0; q->landmark && m < q->landmarks && q->landmark[m].held_out >= 0; m++)
    fprintf(out, "%s%.2f%s", m ? ", " : "; each by the others: ", q->landmark[m].held_out,
            q->landmark[m].best_match != m ? " (misplaced)" : "");
  fprintf(out, "\n");
}

static void regions_text(FILE *out, const ep_map_quality *q) {
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

void ep_quality_text(FILE *out, const char *name, const ep_map_quality *q, const ep_mesh *from,
                     const ep_mesh *to) {
  fprintf(out, "%s: %s%s%s\n", name, ep_verdict_name(q->verdict), q->reasons[0] ? ": " : "",
          q->reasons);
  fprintf(
      out,
      "  coverage %.3f, round trip %.3f, left and right kept %.3f, Dirichlet %.3f, frame turned "
      "by %.1f degrees\n",
      q->coverage, q->cycle, q->handed, q->dirichlet, q->frame_angle);
  fprintf(out, "  distortion %.3f, energy %.4f", q->distortion, q->energy);
  if (q->energy_other >= 0)
    fprintf(out, "; refined from %s, %.4f from the other",
            q->from_nearest ? "nearest points" : "the matching", q->energy_other);
  fprintf(out, "\n");
  landmarks_text(out, q);
  frames_text(out, q, from, to);
  regions_text(out, q);
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
      {"repair_share", q->repair_share},
      {"repair_coefficient_shift", q->repair_shift},
      {"coefficient_error", q->coefficient_error},
      {"fixed_shift", q->fixed_shift},
      {"iterations", q->iterations},
  };
  for (size_t i = 0; object && i < sizeof numbers / sizeof *numbers; i++)
    json_object_set_new(object, numbers[i].key, ep_json_number(numbers[i].value));
  return object;
}

json_t *ep_poses_json(const ep_bake *bake) {
  json_t *list = json_array();
  for (int i = 0; list && bake->quality && i < bake->shapes->examples; i++) {
    json_t *pose = ep_pose_json(&bake->quality[i]);
    if (!pose) break;
    json_object_set_new(pose, "name",
                        ep_json_text(bake->shapes->shape[bake->shapes->example[i].shape].name));
    json_array_append_new(list, pose);
  }
  return list;
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

static const char *region_name(const ep_bake *bake, int set) {
  const int region = bake->shapes->set[set];
  return region < 0 ? "everywhere" : bake->scene->region[region].name;
}

json_t *ep_regions_json(const ep_bake *bake) {
  json_t *list = json_array();
  const ep_cubature *c = &bake->cubature;
  for (int i = 0; list && i < c->regions; i++) {
    const double *about = c->region + (size_t)i * EP_REGION_NUMBERS;
    json_array_append_new(list,
                          json_pack("{s:s, s:i, s:i, s:o, s:o}", "name", region_name(bake, i), "m",
                                    ep_shapes_set_functions(bake->scene, bake->shapes, i),
                                    "elements", (int)about[EP_REGION_ELEMENTS], "train_error",
                                    ep_json_number(about[EP_REGION_TRAIN]), "held_out_error",
                                    ep_json_number(about[EP_REGION_HELD_OUT])));
  }
  return list;
}

void ep_regions_text(FILE *out, const ep_bake *bake) {
  const ep_cubature *c = &bake->cubature;
  for (int i = 0; i < c->regions; i++) {
    const double *about = c->region + (size_t)i * EP_REGION_NUMBERS;
    fprintf(out, "region %s: %.0f elements, force error %.3g in training, %.3g held out\n",
            region_name(bake, i), about[EP_REGION_ELEMENTS], about[EP_REGION_TRAIN],
            about[EP_REGION_HELD_OUT]);
  }
}
