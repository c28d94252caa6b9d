// Maps between shapes: regions, frames, product-space matching, coupled bases, composition, and
// the record by which a person can judge a map. (Kovnatsky et al. 2013; docs/method.md
// "Maps".)
#ifndef EP_ALIGN_ALIGN_H
#define EP_ALIGN_ALIGN_H

#include <stdbool.h>

#include "base/log.h"
#include "lbspace/lbspace.h"

// A mesh with its LB space and mass matrix; all borrowed.
typedef struct ep_shape {
  const ep_mesh *mesh;
  const ep_lb *lb;
  const ep_csr *mass;
} ep_shape;

// Corresponding regions of several shapes: region g of shape s is
// vertex[start[g * shapes + s] .. start[g * shapes + s + 1]), vertices of the mesh from 0.
typedef struct ep_regions {
  int count, shapes;
  int *start;  // (count * shapes + 1)
  int *vertex; // (start[count * shapes])
} ep_regions;

// The authors' .ini: number of regions, then for each one line of 1-based file vertices, each
// followed by ';', for the object and one for each example in order. meshes (shapes) in that order.
// Errors: EP_ERR_FORMAT with file and line: wrong count, empty region, vertex out of range.
ep_status ep_regions_read(const char *path, int shapes, const ep_mesh *const *meshes,
                          ep_regions *out, ep_error *err);
ep_status ep_regions_parse(const char *name, const char *bytes, int shapes,
                           const ep_mesh *const *meshes, ep_regions *out, ep_error *err);
void ep_regions_free(ep_regions *regions);

// A point of one shape that belongs to a point of the other: vertices of the meshes, from 0, or
// where a vertex is -1 a point in space near its mesh (moved to the nearest point of it).
typedef struct ep_landmark {
  int from_vertex, to_vertex;
  double from[3], to[3]; // [model units] of each mesh, read where the vertex is -1
} ep_landmark;

enum { EP_LANDMARKS_MAX = 64 };

typedef enum ep_verdict { EP_MAP_GOOD, EP_MAP_DOUBTFUL, EP_MAP_BAD } ep_verdict;

typedef struct ep_region_quality {
  double residual_before, residual_after; // coupling residual of the region's function, relative
  double jaccard;                         // of the mapped region with the given one, by volume
  int best_match;                         // region of the example that fits clearly best
  bool suspect;                           // best_match differs, or the robust weight gave it up
} ep_region_quality;

// A landmark seen from the others: where the map they give without it sends its vertex.
typedef struct ep_landmark_quality {
  double held_out; // distance of that image to its partner, over the rms radius; -1: not tried
  int best_match;  // landmark whose partner is clearly nearer to it, else its own number
} ep_landmark_quality;

// One frame the map was tried in.
typedef struct ep_frame_candidate {
  char name[32];      // "authored", "landmarks", "regions", "axes", "axes, half turn about x", ..
  double rotation[9]; // to's frame -> from's, after reframing; det -1 where reflected
  bool reflected;
  double start_angle; // degrees between the authored frame and where this one started
  double score;       // lower is better: what the choice went by
  double distance;    // rms distance of the mapped points, over the rms radius, frames aligned
  double cycle;       // round trip, as in the record
  double landmark;    // rms distance of the landmarks in this frame over the rms radius; -1 without
  int rounds;         // how often it was turned to what its map said
  bool chosen, rival; // the map's own frame; another one that is not clearly worse
  bool alone;         // tried without landmarks and regions, as a second opinion
  bool against;       // contradicts the choice: it fits clearly better, or as well as authored
} ep_frame_candidate;

typedef struct ep_map_quality {
  ep_verdict verdict;
  char reasons[1024];                     // why not good; what to give; empty where good
  double residual_before, residual_after; // coupling, all regions (0 without regions)
  double orthogonality;                   // |A^T A - I| max
  double determinant;                     // of A, +-1
  double coverage;                        // share of the example's volume hit by the map
  double cycle; // round trip rms / radius of gyration before the two maps were made inverse to each
                // other, when they knew nothing of each other; of two refined (below) the shorter;
                // -1 where not made
  // Elastic refinement of the map together with its reverse: energy (volumes 1, without the
  // landmarks' term) and rms distortion, 0 where parts move rigidly. Where the round trip was long
  // and no landmarks were given, plain nearest neighbours were refined too and the lower energy
  // kept.
  double energy, energy_other; // of the one kept, of the other; -1 where there was no other
  double distortion;
  bool from_nearest; // the plain neighbours were kept
  double handed; // share of the volume around whose vertices the map keeps left and right, before
                 // that refinement
  double dirichlet;  // of the transferred coordinates over that of the own ones
  int near_multiple; // eigenfunctions in near-multiple groups at the cut or inside
  int reframe_rounds;
  double frame_angle; // degrees between authored and final frame
  int regions;
  ep_region_quality *region; // (regions) or NULL
  int coupled_functions;     // functions the regions alone determine (rank); positions do the rest
  int coupling_k;            // chosen by held-out regions, with mu; 0 without regions
  double coupling_mu, held_out; // relative residual of the regions left out, each in its turn
  int landmarks;
  ep_landmark_quality *landmark; // (landmarks) or NULL; tried with five and more
  double landmark_residual;      // rms of image to partner over the rms radius; 0 without landmarks
  int candidates, rivals, against; // frames tried; of those, rivals of the chosen one and those
                                   // that contradict it
  ep_frame_candidate *candidate;   // (candidates), authored frame first
  // Landmarks (where there are any, else regions), by number, that by the shapes alone seem to have
  // each other's partner; -1 where none do.
  int exchanged, exchanged_with;
  // The landmark that would settle the choice: vertex of `from` and where the chosen frame and the
  // rival take it; -1 where the choice is clear.
  int settle_from, settle_to, settle_other;
  int inverted, inverted_left; // tets of `from` after pose transfer and after repair; -1: not told
} ep_map_quality;

// A map "from" -> "to": for every vertex of `from` a vertex of `to`; functional map and coupled
// basis in the first m functions of each.
typedef struct ep_map {
  int n, m;
  int *p;             // (n) vertex of `to`
  int *tet;           // (n) the tet of `to` that holds the point a vertex is sent to, and
  double *weight;     // (n x 4) the point's barycentric coordinates in it: finer than p
  double *c;          // (m x m) C = Phi_from^T M_from Phi_to[p], row-major
  double *a;          // (m x m) polar(C^T): coupled basis of `to` is Phi_to A
  double rotation[9]; // det -1 only where reflections were asked for; to's frame -> from's frame:
                      // x_from ~ scale R (x_to - ct) + cf
  double scale, center_from[3], center_to[3];
  ep_map_quality quality;
} ep_map;
void ep_map_free(ep_map *map);
// out (n x width) = values (to's vertices x width) at the points the map sends from's vertices to.
void ep_map_pull(const ep_map *map, const ep_mesh *to, int width, const double *values,
                 double *out);
// Tell the record how many tets of `from` the transferred pose left inverted, before and after
// repair: part of the verdict from then on.
void ep_map_note_inverted(ep_map *map, int inverted, int left);

typedef struct ep_map_options {
  int m;                       // functions of the final map
  bool same_family;            // rest and pose of one family: turned poses expected
  const ep_regions *regions;   // NULL: automatic
  int from_column, to_column;  // columns of the two shapes in regions
  int landmarks;               // at most EP_LANDMARKS_MAX
  const ep_landmark *landmark; // (landmarks), borrowed
  bool reflections;            // mirrored frames are candidates too
  bool keep_frame; // the authored frame is believed: the map starts from no other. Others are still
                   // tried by the shapes alone, and one that fits far better makes a doubt
} ep_map_options;
ep_map_options ep_default_map_options(void);

// Functions the spaces of a map's shapes should hold at least: between shapes matching raises to 12
// (map.c), and the group of near-multiple eigenvalues it ends in should be whole; between poses of
// one family it raises to 32.
enum { EP_MAP_SPACE = 25, EP_MAP_SPACE_FAMILY = 32 };

// Product-space matching with reframing (docs/method.md "Maps"). Uses the functions the spaces
// hold, fewer where they are small; the coupling residuals up to 2m of `to`: compute spaces of
// max(EP_MAP_SPACE, 2m), of max(EP_MAP_SPACE_FAMILY, 2m) within a family. Errors:
// EP_ERR_ARGUMENT (m larger than the spaces), EP_ERR_MATCH (component counts differ). A bad map is
// no error here: the verdict says so, the caller decides.
ep_status ep_map_match(const ep_shape *from, const ep_shape *to, const ep_map_options *options,
                       ep_log *log, ep_map *out, ep_error *err);

// pose o rest: points sent on through `middle`, p[i] = second->p[first->p[i]], matrices multiplied,
// quality of the worse. first: from -> middle, second: middle -> to.
ep_status ep_map_compose(const ep_map *first, const ep_mesh *middle, const ep_map *second,
                         const ep_mesh *to, ep_map *out, ep_error *err);

// Coupled basis from region functions with the object's basis fixed (B = I): minimise
//   mu_off * ordered off-diagonal penalty of A^T Lambda A + robust |F^T - G^T A|^2, A^T A = I,
// on the Stiefel manifold (Riemannian descent, polar retraction). k rows, m columns.
typedef struct ep_coupling {
  int k, m;       // example functions used, coupled functions
  bool ordered;   // |A^T Lambda_k A - Lambda_m|^2 instead of plain off()
  double mu_data; // weight of the region rows
  bool robust;    // Cauchy weights on regions
  int iterations;
} ep_coupling;
ep_coupling ep_default_coupling(int m);
// lambda_to (k) and lambda_from (m), dimensionless; f_from (q x m), f_to (q x k): region functions
// in each basis. a (k x m): in: start or zero for Procrustes; out. weight (q) robust weights out.
// *objective final value. Errors: EP_ERR_NUMERIC.
ep_status ep_couple(const ep_coupling *def, int q, const double *lambda_from,
                    const double *lambda_to, const double *f_from, const double *f_to, double *a,
                    double *weight, double *objective, ep_error *err);

#endif
