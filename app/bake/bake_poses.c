// Example poses on the object's mesh: maps, descriptors, as-rigid-as-possible (lbspace/lbspace.h).
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "app/bake/bake.h"
#include "app/bake/pose_local.h"
#include "linalg/dense.h"
#include "reduced/bake/inertia.h"

// A pose whose fixed vertices stray further than this share of the diagonal does not hold still
// what the scene holds: beyond the first figure a warning, beyond the second an error.
static const double shift_doubtful = 0.02, shift_refused = 0.2;
// A repair that moves the object by this share of what the pose itself does (rms) has made another
// pose of it. Real poses: below 0.01; a mirrored one, which is turned inside out again: 2.
static const double share_doubtful = 0.1, share_refused = 0.5;

static ep_status no_memory(ep_error *err) {
  return ep_fail(err, EP_ERR_MEMORY, "no memory for the example poses");
}

// Rigidly move positions y (n x 3) so that the listed vertices come nearest to rest x; with fewer
// than three spread vertices only the translation is removed.
static ep_status bring_back(const ep_mesh *mesh, int count, const int *list, double *y,
                            ep_error *err) {
  double *from = malloc(6 * (size_t)count * sizeof *from);
  if (!from) return no_memory(err);
  double *to = from + 3 * (size_t)count;
  for (int i = 0; i < count; i++)
    for (int a = 0; a < 3; a++) {
      from[3 * i + a] = y[3 * (size_t)list[i] + (size_t)a];
      to[3 * i + a] = mesh->x[3 * (size_t)list[i] + (size_t)a];
    }
  double r[9], cf[3], ct[3];
  ep_error spread = {0}; // R is then the identity, which is what is wanted
  const ep_status status = ep_kabsch(count, from, to, NULL, r, cf, ct, &spread);
  free(from);
  if (status != EP_OK && status != EP_ERR_NUMERIC) return ep_fail(err, status, "%s", spread.text);
  for (int v = 0; v < mesh->nv; v++) {
    double *p = y + 3 * (size_t)v;
    const double d[3] = {p[0] - cf[0], p[1] - cf[1], p[2] - cf[2]};
    for (int a = 0; a < 3; a++)
      p[a] = ct[a] + r[3 * a] * d[0] + r[3 * a + 1] * d[1] + r[3 * a + 2] * d[2];
  }
  return EP_OK;
}

// How far the fixed vertices are off rest in displacement u: rms over the diagonal.
static double shift_of(const ep_shapes *shapes, const double *u) {
  double sum = 0;
  if (!shapes->nfixed) return 0;
  for (int i = 0; i < shapes->nfixed; i++)
    for (int a = 0; a < 3; a++) {
      const double d = u[3 * (size_t)shapes->fixed[i] + (size_t)a];
      sum += d * d;
    }
  return sqrt(sum / shapes->nfixed) / ep_mesh_diagonal(&shapes->shape[0].mesh);
}

// Displacement of the pose against its rest shape at the rest shape's vertices, out (n x 3), after
// the best rotation of the pose onto the rest. map: rest -> pose, NULL: vertices correspond.
static ep_status pose_minus_rest(const ep_mesh *rest, const ep_mesh *pose, const ep_map *map,
                                 double *out, ep_error *err) {
  const size_t n = (size_t)rest->nv;
  double *weight = malloc(n * sizeof *weight), r[9], cp[3], cr[3];
  if (!weight) return no_memory(err);
  ep_mesh_vertex_volumes(rest, weight);
  if (map)
    ep_map_pull(map, pose, 3, pose->x, out);
  else
    memcpy(out, pose->x, 3 * n * sizeof *out);
  const ep_status status = ep_kabsch(rest->nv, out, rest->x, weight, r, cp, cr, err);
  free(weight);
  if (status != EP_OK) return status;
  for (size_t v = 0; v < n; v++) {
    const double d[3] = {out[3 * v] - cp[0], out[3 * v + 1] - cp[1], out[3 * v + 2] - cp[2]};
    for (size_t a = 0; a < 3; a++)
      out[3 * v + a] =
          cr[a] + r[3 * a] * d[0] + r[3 * a + 1] * d[1] + r[3 * a + 2] * d[2] - rest->x[3 * v + a];
  }
  return EP_OK;
}

// Pull a field on the rest shape back to the object: u[v] = scale R field(image of v).
static void pull_back(const ep_mesh *object, const ep_mesh *rest, const ep_map *map, double scale,
                      const double *field, double *u) {
  static const double identity[9] = {1, 0, 0, 0, 1, 0, 0, 0, 1};
  const double *r = map ? map->rotation : identity;
  if (map)
    ep_map_pull(map, rest, 3, field, u);
  else
    memcpy(u, field, 3 * (size_t)object->nv * sizeof *u);
  for (size_t v = 0; v < (size_t)object->nv; v++) {
    const double d[3] = {u[3 * v], u[3 * v + 1], u[3 * v + 2]};
    for (size_t a = 0; a < 3; a++)
      u[3 * v + a] = scale * (r[3 * a] * d[0] + r[3 * a + 1] * d[1] + r[3 * a + 2] * d[2]);
  }
}

static ep_status judge(const ep_bake *bake, const ep_stage *stage, const ep_map *map,
                       ep_error *err) {
  const ep_family *family = &bake->scene->family[stage->family];
  if (map->quality.verdict == EP_MAP_GOOD) return EP_OK;
  if (map->quality.verdict == EP_MAP_BAD && !family->accept && !bake->look)
    return ep_fail(err, EP_ERR_MATCH,
                   "%s: the map is bad: %s. Look at it with 'eigenpose align', or go on with "
                   "map: {accept: true} in family '%s'",
                   stage->name, map->quality.reasons, family->name);
  if (map->quality.verdict == EP_MAP_DOUBTFUL && !stage->cached) return EP_OK; // said when mapped
  ep_warn(bake->log, "%s: the map is %s: %s", stage->name,
          map->quality.verdict == EP_MAP_DOUBTFUL ? "doubtful"
          : family->accept                        ? "bad (accepted)"
                                                  : "bad",
          map->quality.reasons);
  return EP_OK;
}

// Regions the rest of the map contradicts, by number: the file is to be corrected even where the
// map is good without them.
static void warn_of_suspects(const ep_bake *bake, const ep_stage *stage, const ep_map_quality *q) {
  char list[240] = "";
  size_t used = 0;
  const char *file = bake->scene->family[stage->family].regions;
  for (int i = 0; q->region && i < q->regions && used + 40 < sizeof list; i++)
    if (q->region[i].suspect)
      used += (size_t)snprintf(list + used, sizeof list - used, "%s%d (fits %d)", used ? ", " : "",
                               i + 1, q->region[i].best_match + 1);
  if (used)
    ep_warn(bake->log, "%s: regions that do not belong together, left out: %s; check %s",
            stage->name, list, file ? file : "map.fields");
}

static ep_status get_map(ep_bake *bake, int from, int to, const ep_map **out, ep_error *err) {
  ep_stage *stage = ep_plan_map(bake->plan, from, to);
  EP_TRY(ep_bake_map(bake, stage, out, err));
  warn_of_suspects(bake, stage, &(*out)->quality);
  return judge(bake, stage, *out, err);
}

// The example's displacement field at the object's vertices, u (n x 3), not yet held anywhere.
static ep_status transfer(ep_bake *bake, const ep_pose_source *example, double *u, ep_error *err) {
  const ep_mesh *object = &bake->shapes->shape[0].mesh;
  const ep_mesh *rest = &bake->shapes->shape[example->rest].mesh;
  const ep_map *to_rest = NULL, *to_pose = NULL;
  if (!example->rest_same) EP_TRY(get_map(bake, 0, example->rest, &to_rest, err));
  if (!example->pose_same) EP_TRY(get_map(bake, example->rest, example->shape, &to_pose, err));
  double *field = malloc(3 * (size_t)rest->nv * sizeof *field);
  if (!field) return no_memory(err);
  const ep_status status =
      pose_minus_rest(rest, &bake->shapes->shape[example->shape].mesh, to_pose, field, err);
  const double scale = cbrt(ep_mesh_volume(object) / ep_mesh_volume(rest));
  if (status == EP_OK) pull_back(object, rest, to_rest, scale, field, u);
  free(field);
  return status;
}

// u becomes R (x + u) + t - x, with the fixed vertices as near to rest as a rigid motion can; a
// free object is fitted at the end, by its mass (fit_free).
static ep_status hold_rigidly(const ep_shapes *shapes, double *u, ep_error *err) {
  const ep_mesh *mesh = &shapes->shape[0].mesh;
  const size_t n3 = 3 * (size_t)mesh->nv;
  if (!shapes->nfixed) return EP_OK;
  for (size_t i = 0; i < n3; i++) u[i] += mesh->x[i];
  EP_TRY(bring_back(mesh, shapes->nfixed, shapes->fixed, u, err));
  for (size_t i = 0; i < n3; i++) u[i] -= mesh->x[i];
  return EP_OK;
}

// The pose where it belongs: held by the fixed vertices, or limited to a region (limits not NULL).
static ep_status place(const ep_bake *bake, const ep_pose_limits *limits, double *u,
                       ep_pose_quality *quality, ep_error *err) {
  if (limits) return ep_pose_limit(limits, u, &quality->fixed_shift, err);
  EP_TRY(hold_rigidly(bake->shapes, u, err));
  quality->fixed_shift = shift_of(bake->shapes, u);
  return EP_OK;
}

// A pose on the object's own connectivity: the fixed vertices are set to rest exactly.
static ep_status pose_direct(ep_bake *bake, const ep_pose_source *example,
                             const ep_pose_limits *limits, double *u, ep_pose_quality *quality,
                             ep_error *err) {
  EP_TRY(transfer(bake, example, u, err));
  EP_TRY(place(bake, limits, u, quality, err));
  for (int i = 0; i < bake->shapes->nfixed; i++)
    memset(u + 3 * (size_t)bake->shapes->fixed[i], 0, 3 * sizeof *u);
  return EP_OK;
}

static int functions_of(const ep_bake *bake, const ep_pose_source *example) {
  return bake->shapes->sets ? ep_shapes_set_functions(bake->scene, bake->shapes, example->set)
                            : bake->scene->eigenfunctions;
}

// A pose of another mesh: its low coefficients d, the rest as rigid as possible. The rigid motion
// that holds the fixed vertices is found on the smooth shape X + Phi d and applied before the
// coefficients are taken, because Phi leaves the constant function out.
static ep_status pose_mapped(ep_bake *bake, const ep_pose_source *example,
                             const ep_pose_limits *limits, const unsigned char *held, double *u,
                             ep_pose_quality *quality, ep_error *err) {
  const ep_mesh *mesh = &bake->shapes->shape[0].mesh;
  EP_TRY(ep_bake_lb(bake, 0, err));
  EP_TRY(transfer(bake, example, u, err));
  const ep_lb *all = &bake->lb[0];
  ep_lb low = *all; // the first m functions of the same space
  low.m = functions_of(bake, example);
  double *d = malloc(3 * (size_t)low.m * sizeof *d);
  if (!d) return no_memory(err);
  ep_lb_project(&low, &bake->mass[0], u, d);
  ep_lb_reconstruct(&low, d, u);
  ep_status status = place(bake, limits, u, quality, err);
  if (status == EP_OK) {
    ep_lb_project(&low, &bake->mass[0], u, d);
    ep_pose_options options = ep_default_pose_options();
    options.m = low.m;
    options.held = held;
    ep_pose_report report;
    status = ep_lb_pose(mesh, &low, d, &options, u, &report, err);
    if (status == EP_OK) {
      quality->iterations = report.iterations;
      quality->coefficient_error = report.coefficient_error;
    }
  }
  free(d);
  return status;
}

// Say what is wrong with a pose: an error, or a warning where it was accepted beforehand or is only
// being looked at.
static ep_status complain(const ep_bake *bake, int index, ep_error *err, const char *text) {
  const ep_family *family = &bake->scene->family[bake->shapes->example[index].family];
  const char *name = bake->shapes->shape[bake->shapes->example[index].shape].name;
  if (!family->accept && !bake->look)
    return ep_fail(err, EP_ERR_MATCH, "example %s: %s, or go on with map: {accept: true}", name,
                   text);
  ep_warn(bake->log, "example %s: %s%s", name, text, family->accept ? " (accepted)" : "");
  return EP_OK;
}

static ep_status report_shift(const ep_bake *bake, int index, ep_error *err) {
  const ep_pose_quality *q = &bake->quality[index];
  char text[320];
  if (ep_shapes_local(bake->shapes, &bake->shapes->example[index])) {
    if (q->fixed_shift > shift_doubtful)
      ep_warn(bake->log,
              "example %s does not leave the edge of its region as it is: off by %.2g of the "
              "diagonal (rms); give the region more of the pose, or a longer soft edge",
              bake->shapes->shape[bake->shapes->example[index].shape].name, q->fixed_shift);
    return EP_OK;
  }
  if (q->fixed_shift > shift_refused) {
    snprintf(text, sizeof text,
             "the fixed vertices would move by %.2g of the diagonal (rms) in it; hold what stands "
             "still in the pose, or make a pose that holds them",
             q->fixed_shift);
    return complain(bake, index, err, text);
  }
  if (q->fixed_shift > shift_doubtful)
    ep_warn(bake->log,
            "example %s moves the fixed vertices by %.2g of the diagonal (rms); they "
            "are held at rest and the pose gives way there",
            bake->shapes->shape[bake->shapes->example[index].shape].name, q->fixed_shift);
  return EP_OK;
}

static ep_status report_tets(const ep_bake *bake, int index, ep_error *err) {
  const ep_pose_quality *q = &bake->quality[index];
  const char *name = bake->shapes->shape[bake->shapes->example[index].shape].name;
  char text[320];
  if (q->inverted_tets > 0) {
    snprintf(text, sizeof text,
             "%.0f tets stay inverted on the object's mesh after repair (%.0f before; smallest "
             "volume %.2g of rest); look at the map and the pose with 'eigenpose align', give a "
             "milder pose or other eigenfunctions",
             q->inverted_tets, q->inverted_before, q->worst_volume_ratio);
    return complain(bake, index, err, text);
  }
  if (q->repair_share > share_refused) {
    snprintf(text, sizeof text,
             "%.0f tets are inverted on the object's mesh, and their repair moves it by %.2g of "
             "what the pose does: that is another pose. Is the example a mirror image? Look at it "
             "with 'eigenpose align'",
             q->inverted_before, q->repair_share);
    return complain(bake, index, err, text);
  }
  if (q->repair_share > share_doubtful)
    ep_warn(bake->log,
            "example %s: %.0f inverted and %.0f crushed tets repaired, which moved the object by "
            "%.2g of what the pose does",
            name, q->inverted_before, q->crushed_before - q->inverted_before, q->repair_share);
  if (q->crushed_tets > 0)
    ep_warn(bake->log,
            "example %s: %.0f tets stay crushed (smallest volume %.2g of rest); they cannot serve "
            "as cubature elements",
            name, q->crushed_tets, q->worst_volume_ratio);
  else if (q->crushed_before > 0)
    ep_notice(bake->log,
              "example %s: %.0f inverted and %.0f crushed tets repaired; vertices moved by %.1e of "
              "the diagonal (rms, %.1e at most)",
              name, q->inverted_before, q->crushed_before - q->inverted_before, q->repair_moved,
              q->repair_moved_most);
  return EP_OK;
}

// Inverted and crushed tets are given volume back, the low coefficients kept.
static ep_status repair_pose(ep_bake *bake, const ep_pose_source *example,
                             const unsigned char *held, double *u, ep_pose_quality *quality,
                             ep_error *err) {
  const bool mapped = example->route == EP_ROUTE_MAP;
  ep_repair_options options = ep_default_repair_options();
  ep_repair_report report;
  options.m = mapped ? functions_of(bake, example) : 0;
  options.held = held;
  EP_TRY(ep_lb_repair(&bake->shapes->shape[0].mesh, mapped ? &bake->lb[0] : NULL, &options, u,
                      &report, err));
  quality->inverted_before = report.inverted_before;
  quality->inverted_tets = report.inverted_after;
  quality->crushed_before = report.crushed_before;
  quality->crushed_tets = report.crushed_after;
  quality->worst_before = report.worst_before;
  quality->worst_volume_ratio = report.worst_after;
  quality->repair_moved = report.moved;
  quality->repair_moved_most = report.moved_most;
  quality->repair_share = report.moved_share;
  quality->repair_shift = report.coefficient_shift;
  return EP_OK;
}

static ep_status make_pose(ep_bake *bake, int index, const unsigned char *fixed, ep_error *err) {
  const ep_pose_source *example = &bake->shapes->example[index];
  const double *region = ep_shapes_local(bake->shapes, example);
  ep_pose_limits local = {0}, *limits = region ? &local : NULL;
  double *u = bake->poses + (size_t)index * 3 * (size_t)bake->shapes->shape[0].mesh.nv;
  ep_pose_quality *quality = &bake->quality[index];
  if (region) EP_TRY(ep_pose_limits_make(bake->shapes, region, limits, err));
  const unsigned char *held = region ? limits->held : fixed;
  ep_status status = example->route == EP_ROUTE_SAME
                         ? pose_direct(bake, example, limits, u, quality, err)
                         : pose_mapped(bake, example, limits, held, u, quality, err);
  if (status == EP_OK) status = repair_pose(bake, example, held, u, quality, err);
  ep_pose_limits_free(&local);
  if (status != EP_OK)
    return ep_fail_context(err, "example %s", bake->shapes->shape[example->shape].name);
  EP_TRY(report_shift(bake, index, err));
  return report_tets(bake, index, err);
}

enum { POSE_NUMBERS = sizeof(ep_pose_quality) / sizeof(double) };

// Everything the poses build on first, so that the stage's own time is its own.
static ep_status gather(ep_bake *bake, ep_error *err) {
  for (int i = 0; i < bake->shapes->examples; i++) {
    const ep_pose_source *e = &bake->shapes->example[i];
    const ep_map *map;
    if (e->route == EP_ROUTE_SAME) continue;
    EP_TRY(ep_bake_lb(bake, 0, err));
    if (!e->rest_same) EP_TRY(ep_bake_map(bake, ep_plan_map(bake->plan, 0, e->rest), &map, err));
    if (!e->pose_same)
      EP_TRY(ep_bake_map(bake, ep_plan_map(bake->plan, e->rest, e->shape), &map, err));
  }
  return EP_OK;
}

static ep_status compute_poses(ep_bake *bake, ep_bake_step *step, ep_error *err) {
  const ep_mesh *mesh = &bake->shapes->shape[0].mesh;
  const size_t k = (size_t)bake->shapes->examples, n = (size_t)mesh->nv;
  EP_TRY(gather(bake, err));
  EP_TRY(ep_bake_compute(bake, step, err));
  bake->poses = calloc(k * 3 * n, sizeof *bake->poses);
  bake->quality = calloc(k, sizeof *bake->quality);
  // a free object has no such marks at all: pose and repair tell by that
  unsigned char *held = bake->shapes->nfixed ? calloc(n, 1) : NULL;
  const bool marked = held || !bake->shapes->nfixed;
  ep_status status = bake->poses && bake->quality && marked ? EP_OK : no_memory(err);
  for (int i = 0; status == EP_OK && i < bake->shapes->nfixed; i++)
    held[bake->shapes->fixed[i]] = 1;
  if (status == EP_OK) ep_progress_begin(bake->log, "example poses", (long)k);
  for (int i = 0; i < bake->shapes->examples && status == EP_OK; i++) {
    status = make_pose(bake, i, held, err);
    ep_progress(bake->log, i + 1);
  }
  ep_progress_end(bake->log);
  free(held);
  if (status != EP_OK || bake->look) return status;
  const ep_tensor tensors[] = {
      ep_tensor_of("u", EP_F64, bake->poses, (int64_t)k, (int64_t)(3 * n), 0),
      ep_tensor_of("quality", EP_F64, bake->quality, (int64_t)k, POSE_NUMBERS, 0),
  };
  return ep_cache_store(bake->cache, step->stage->name, &step->stage->key, 2, tensors, 0, NULL,
                        err);
}

static bool take_poses(ep_bake *bake, const ep_bake_step *step) {
  const size_t k = (size_t)bake->shapes->examples, n = (size_t)bake->shapes->shape[0].mesh.nv;
  double *quality = NULL;
  if (!ep_bake_take(step, "u", k * 3 * n, &bake->poses)) return false;
  if (!ep_bake_take(step, "quality", k * POSE_NUMBERS, &quality)) {
    free(bake->poses);
    bake->poses = NULL;
    return false;
  }
  bake->quality = (ep_pose_quality *)(void *)quality;
  return true;
}

// Poses of a free object, moved as near to rest as rigid motions can in the mass norm: only then
// are they in the span of a basis free of rigid modes. Not in the cache: densities play a part.
static ep_status fit_free(ep_bake *bake, ep_error *err) {
  const ep_mesh *mesh = &bake->shapes->shape[0].mesh;
  ep_csr mass = {0};
  EP_TRY(ep_bake_fem(bake, err));
  EP_TRY(ep_fem_scalar_mass(&bake->fem, &mass, err));
  ep_status status = EP_OK;
  for (int i = 0; i < bake->shapes->examples && status == EP_OK; i++)
    status = ep_rigid_fit(mesh, &mass, bake->poses + (size_t)i * 3 * (size_t)mesh->nv, err);
  ep_csr_free(&mass);
  return status;
}

ep_status ep_bake_poses(ep_bake *bake, ep_error *err) {
  ep_stage *stage = ep_plan_find(bake->plan, EP_STAGE_POSES);
  if (bake->poses || !stage->runs) return EP_OK;
  EP_TRY(ep_bake_stage(bake, stage, take_poses, compute_poses, err));
  return bake->shapes->nfixed ? EP_OK : ep_bake_status(stage, fit_free(bake, err), err);
}
