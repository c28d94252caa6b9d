// Shared by the files of align/ and by its tests; not for other folders.
#ifndef EP_ALIGN_PRIVATE_H
#define EP_ALIGN_PRIVATE_H

#include <stddef.h>

#include "align/align.h"

// ---- neighbours.c: exact nearest neighbours by a tree of tight bounding boxes.
// The product space has 6 to 80 coordinates, but its points lie near a three-dimensional body, so
// boxes prune nearly as well as in space: far less work than all distances by dgemm.
typedef struct ep_tree ep_tree;

// points (n x d) row-major, copied. Memory: about 1.5 times the points. Errors: EP_ERR_ARGUMENT for
// n < 1 or d < 1, memory.
ep_status ep_tree_make(int n, int d, const double *points, ep_tree **out, ep_error *err);
void ep_tree_free(ep_tree *tree);
// nearest (count): in: a guess for each query (an index, any is right) or -1; out: index of the
// nearest point, the lowest index among equals. queries (count x d).
void ep_tree_nearest(const ep_tree *tree, int count, const double *queries, int *nearest);

// ---- points.c
// The nearest point of the mesh whose vertices have `coords` (nv x d), for each query (count x d):
// its tet and barycentric coordinates (count x 4). Searched downhill from the tets around vertex
// start[i]. Errors: memory.
ep_status ep_points_project(const ep_mesh *mesh, int d, const double *coords, int count,
                            const double *query, const int *start, int *tet, double *weight,
                            ep_error *err);

// A map to points in tets: for each vertex the nearest vertex of the other mesh, the tet that holds
// its image and the image's barycentric coordinates there.
typedef struct ep_point_map {
  int *p, *tet;   // (n)
  double *weight; // (n x 4)
} ep_point_map;
ep_status ep_point_map_make(int n, ep_point_map *out, ep_error *err);
void ep_point_map_free(ep_point_map *map);
// tet and weight of the vertices p of `to`.
ep_status ep_point_map_from_vertices(int n, const ep_mesh *to, ep_point_map *map, ep_error *err);
// Distance of two points.
double ep_points_distance(const double a[3], const double b[3]);
// out (n x width) = values (to's vertices x width) at the images. Takes tet and weight only.
void ep_point_map_pull(const ep_point_map *map, int n, const ep_mesh *to, int width,
                       const double *values, double *out);

// ---- side.c: a shape made scale-free: centred at its centroid, lengths over V^(1/3), functions
// times sqrt(V), so that both sides of a map are comparable.
typedef struct ep_side {
  const ep_shape *shape;
  int n, k;                         // vertices; functions in use
  double length, centre[3], radius; // V^(1/3), centroid [model units]; rms radius over length
  double *x;                        // (n x 3)
  double *phi, *mphi;               // (n x k) vertex by vertex; mphi = M phi / V: mphi^T phi = I
  double *share;                    // (n) vertex volume over V
  ep_csr stiffness;
  int regions;
  double *indicator; // (n x regions) 0 or 1
  double *region;    // (n x regions) smoothed
  double *skin;      // (n) 1 on the boundary, 0 inside
  int marks;
  bool splines;      // which functions the landmarks have
  double *mark;      // (n x marks) smooth bump around each landmark, mean square 1; or its spline
  double *mark_x;    // (marks x 3) landmarks, like x
  int *mark_near;    // (marks) vertex nearest to each
  double *mark_gram; // (marks x marks) kernel of the splines between landmarks; NULL without
} ep_side;

ep_status ep_side_make(const ep_shape *shape, int k, ep_side *out, ep_error *err);
// Indicators of the regions' column and their smoothed form (M + t K) s = M 1_R.
ep_status ep_side_regions(ep_side *side, const ep_regions *regions, int column, ep_error *err);
// f (n x columns) replaced by (M + t K)^-1 M f, t = (width V^(1/3))^2.
ep_status ep_side_blur(const ep_side *side, double width, int columns, double *f, ep_error *err);
// Errors: EP_ERR_ARGUMENT for a vertex out of range, a point outside the mesh.
ep_status ep_side_landmarks(ep_side *side, int count, const ep_landmark *marks, bool is_from,
                            ep_error *err);
// ---- spline.c
// mark (n x marks) = for each landmark a smooth function, 1 there and 0 at the others.
ep_status ep_side_splines(ep_side *side, ep_error *err);
// y (n x 3): from's positions moved so that its landmarks come near their partners (marks x 3, in
// from's frame): an affine part held towards the identity, the rest spread by the splines. Without
// splines y = x.
ep_status ep_side_warp(const ep_side *from, const double *partner, double *y, ep_error *err);

// The side on `count` of its vertices: sample (count), owner (n) the sample nearest to each vertex.
// No stiffness: such a side can be matched, not judged.
ep_status ep_side_coarsen(const ep_side *side, int count, ep_side *out, int *sample, int *owner,
                          ep_error *err);
void ep_side_free(ep_side *side);
// Number of connected components of a mesh, or -1 without memory.
int ep_components(const ep_mesh *mesh);

// ---- frame.c
void ep_frame_identity(double r[9]);
double ep_frame_angle(const double r[9]); // degrees
void ep_frame_multiply(const double a[9], const double b[9], double out[9]); // may alias
void ep_frame_transpose(const double a[9], double out[9]);
// y (n x 3) = R x, row by row.
void ep_frame_apply(int n, const double r[9], const double *x, double *y);
// Rotation taking `to` to `from` from the centroids of the regions in use (Kabsch with Cauchy
// weights: files hold wrong regions). *found = false, R = identity: fewer than four, or not spread.
ep_status ep_frame_from_regions(const ep_side *from, const ep_side *to, const unsigned char *use,
                                double r[9], bool *found, ep_error *err);
// Rotation (mirrored: times -1) taking `to` to `from` from a map p, weighted by volume.
ep_status ep_frame_from_map(const ep_side *from, const ep_side *to, const int *p, bool mirrored,
                            double r[9], ep_error *err);
// Of the four proper matches of principal axes the one nearest the authored frame.
ep_status ep_frame_from_axes(const ep_side *from, const ep_side *to, double r[9], ep_error *err);
// Principal axes as rows of a proper rotation, longest last, and the variances along them.
ep_status ep_frame_axes(const ep_side *side, double v[9], double variance[3], ep_error *err);

// ---- match.c: product-space matching in a given frame.
typedef struct ep_match_rule {
  int k, step;              // functions raised up to, by so many a level
  double gamma;             // weight of positions
  double region_weight;     // weight of regions, 0 without
  double mark_weight;       // weight of landmarks, 0 without
  double skin_weight;       // weight of being on the boundary
  double stiffness;         // of the elastic refinement, against distances (volumes 1);
  int rounds;               // its rounds; each goes on by
  double momentum;          // so much of the way of the one before, 0: none
  bool refine;              // p is a map already: the last level only, or those from
  int first;                // this number of functions on; 0: the last
  const unsigned char *use; // (regions) which take part, NULL: all
} ep_match_rule;

// p (from->n): the map in frame r; tet (n), weight (n x 4): the finer map, both or neither NULL,
// only on sides with all their vertices.
// Errors: memory.
ep_status ep_match_levels(const ep_side *from, const ep_side *to, const double r[9],
                          const ep_match_rule *rule, int *p, int *tet, double *weight,
                          ep_error *err);
// Nearest neighbours of the positions alone.
ep_status ep_match_plain(const ep_side *from, const ep_side *to, const double r[9], int *p,
                         int *tet, double *weight, ep_error *err);
// C (k x k) = Phi_from^T M Phi_to[p], scale-free.
ep_status ep_match_functional(const ep_side *from, const ep_side *to, const int *p, double *c,
                              ep_error *err);
// The points of `to` nearest to y (from->n x 3, in from's frame), those of the boundary on the
// boundary, those of a region in it: map (p in: where the search starts). Functions and landmarks
// take no part.
ep_status ep_match_positions(const ep_side *from, const ep_side *to, const double r[9],
                             const ep_match_rule *rule, const double *y, ep_point_map *map,
                             ep_error *err);
// Round trip from -> to -> from: rms over the rms radius.
double ep_match_cycle(const ep_side *from, const int *p, const int *back);

// ---- elastic.c: both maps of a pair made smooth and inverse to each other.
typedef struct ep_elastic_quality {
  double energy; // both ways (volumes 1), without the landmarks' term: lower is the likelier map
  double distortion; // rms of |grad y - R| both ways: 0 where every part moves rigidly
} ep_elastic_quality;
// In frame r (to's frame -> from's). there, back: in: maps of points; out: the refined ones.
ep_status ep_elastic_refine(const ep_side *from, const ep_side *to, const double r[9],
                            const ep_match_rule *rule, ep_point_map *there, ep_point_map *back,
                            ep_elastic_quality *quality, ep_error *err);

// ---- trial.c: a map there and back from one start frame.
typedef struct ep_trial {
  double r[9], cycle;
  int rounds;
  bool plain; // nearest neighbours in space
  int *p, *back;
} ep_trial;
ep_status ep_trial_make(const ep_side *from, const ep_side *to, ep_trial *t, ep_error *err);
void ep_trial_free(ep_trial *t);
// Match in frame t->r, turn the frame to what the map says, match again, at most `rounds` times;
// then the way back.
ep_status ep_trial_run(const ep_side *from, const ep_side *to, const ep_match_rule *rule,
                       int rounds, ep_trial *t, ep_error *err);
double ep_frame_between(const double a[9], const double b[9]); // degrees; 180 where one is mirrored

// ---- candidates.c: frames tried on coarse sides.
enum { EP_CANDIDATES_MAX = 64 };
typedef struct ep_candidates {
  int count, chosen, preferred, rivals, against;
  int exchanged[2]; // landmarks, else regions, that seem to have each other's partner; or -1
  int settle_from, settle_to, settle_other; // samples, -1 where the choice is clear
  ep_frame_candidate frame[EP_CANDIDATES_MAX];
  int *p[EP_CANDIDATES_MAX]; // (from->n) the map found in each frame
} ep_candidates;
ep_status ep_candidates_try(const ep_side *from, const ep_side *to, const ep_match_rule *rule,
                            const ep_map_options *o, ep_candidates *c, ep_error *err);
void ep_candidates_free(ep_candidates *c);
// A frame to try; one too many is left out.
void ep_candidates_add(ep_candidates *c, const double r[9], const char *name);
// Principal axes matched in all proper (or all mirrored) ways.
ep_status ep_candidates_add_axes(ep_candidates *c, const ep_side *from, const ep_side *to,
                                 bool mirrored, ep_error *err);
// Try frame `which`: its figures and its map p.
ep_status ep_candidates_run(const ep_side *from, const ep_side *to, const ep_match_rule *rule,
                            int rounds, ep_candidates *c, int which, ep_error *err);
void ep_candidates_drop(ep_candidates *c, int which);
// Whether frame `which` is, but for a few degrees, one of those from `first` to the one before it:
// both would end in the same map.
bool ep_candidates_repeats(const ep_candidates *c, int first, int which);
// Rms distance of the images of two maps over to's rms radius.
double ep_candidates_difference(const ep_side *from, const ep_side *to, const int *p, const int *q);
// A score is clearly better by this factor: right frames of shapes without symmetry were 1.5 to
// 2.5 times better than any flip, those of near-symmetric shapes 0.8 to 1.2 (own measurement,
// bench_maps and data/). Maps that differ by less are one: a flip moves points by the radius.
#define EP_FRAME_CLEARLY 1.4
#define EP_FRAME_SAME    0.35

// ---- opinion.c: what the shapes alone say of a frame somebody gave.
// Frames are tried without landmarks and regions where a family, the user or they chose: all flips
// of the axes, the authored frame, the chosen one. Those that contradict the choice are marked and
// counted. Between shapes of one family nobody chose: a far better frame is taken.
ep_status ep_candidates_second_opinion(const ep_side *from, const ep_side *to,
                                       const ep_match_rule *rule, const ep_map_options *o,
                                       ep_candidates *c, ep_error *err);

// ---- held_marks.c
// Each landmark mapped by the others alone, in frame r: out (from->marks). Fewer than five: all -1,
// splines of fewer than four say nothing about the rest. Sides may be coarse.
ep_status ep_held_marks(const ep_side *from, const ep_side *to, const ep_match_rule *rule,
                        const double r[9], ep_landmark_quality *out, ep_error *err);

// ---- couple.c: the objective and its Euclidean gradient (tests compare with differences).
typedef struct ep_couple_problem {
  int k, m, q;
  bool ordered;
  double mu_data;
  double scale; // Cauchy scale of the region residuals; 0: plain least squares
  const double *lambda_from, *lambda_to, *f_from, *f_to;
} ep_couple_problem;
// gradient (k x m) or NULL, weight (q) or NULL; work: ep_couple_work(problem) doubles.
double ep_couple_objective(const ep_couple_problem *problem, const double *a, double *gradient,
                           double *weight, double *work);
size_t ep_couple_work(const ep_couple_problem *problem);
// Descent on the Stiefel manifold from a (k x m, orthonormal columns). Returns the objective.
ep_status ep_couple_descend(const ep_couple_problem *problem, int iterations, double *a,
                            double *objective, ep_error *err);

// ---- choose.c
// How many functions the regions determine: rank of f_from (q x m). -1 without memory.
int ep_couple_determined(int q, int m, const double *f_from);
// Choose def->k (m or most) and def->mu_data by held-out regions; *residual: relative, of the
// choice, 0 with fewer than six regions, where def stays as it is. f_to (q x most).
ep_status ep_couple_choose(ep_coupling *def, int most, int q, const double *lambda_from,
                           const double *lambda_to, const double *f_from, const double *f_to,
                           double *residual, ep_error *err);

// ---- quality.c
// Another region fits clearly better by this, of the overlap below.
#define EP_REGION_CLEARLY 0.15
// How well region h of `to`, pulled back by p, covers region g of `from`: volume of the common part
// over that of the union. out (regions x regions), row g.
ep_status ep_region_overlap(const ep_side *from, const ep_side *to, const int *p, double *out,
                            ep_error *err);
// Regions a map contradicts (another fits clearly better) and those left out already (use NULL or
// (regions)). suspect, best (regions) out: best is the own partner unless another is clearly
// better.
void ep_region_suspects(int regions, const double *overlap, const unsigned char *use,
                        unsigned char *suspect, int *best);
// Share of the volume around whose vertices the images of the tets have, together, the handedness
// of the tets: a map that exchanges left and right inside a shape, or folds it, loses it there. r:
// to's frame -> from's.
ep_status ep_map_handedness(const ep_side *from, const ep_side *to, const double r[9],
                            const ep_point_map *map, double *handed, ep_error *err);
// Fill map->quality (cycle, handed, frame, rounds given by the caller) and the verdict. use
// (regions) says which regions took part; dropped ones are recorded as suspect. same_family: larger
// turns of the frame are expected.
ep_status ep_map_judge(const ep_side *from, const ep_side *to, const unsigned char *use,
                       bool same_family, ep_map *map, ep_error *err);
// ---- verdict.c
// Verdict and reasons from what the record holds; the meshes for names and numbers of vertices.
void ep_map_verdict(const ep_mesh *from, const ep_mesh *to, bool same_family, ep_map *map);

#endif
