// Pairs of shapes whose true correspondence is known at every point: bodies made of boxes of a
// parameter grid, placed in space by a formula; meshes of data/ deformed by a formula.
#ifndef EP_TESTS_ALIGN_PAIRS_H
#define EP_TESTS_ALIGN_PAIRS_H

#include "shapes.h"

typedef enum body { BODY_BAR, BODY_FLYER, BODY_BEAST, BODIES } body;

// The body's boxes, every cell of the parameter grid split into refine^3 cubes of six tets, inner
// vertices moved a little (seed) so that no two meshes share their pattern. u (nv x 3) parameters.
void body_mesh(body which, int refine, unsigned seed, placement place, ep_mesh *mesh, double **u);

// Placements of the bar (1 x .31 x .28), of the flyer and of the beast.
void place_bar(const double u[3], double x[3]);
void place_bar_bent(const double u[3], double x[3]);    // by 90 degrees, an arc
void place_bar_twisted(const double u[3], double x[3]); // by 90 degrees, end to end
void place_bar_curled(const double u[3], double x[3]);  // both
void place_rod(const double u[3], double x[3]);         // the bar as an elliptical cylinder
void place_plane(const double u[3], double x[3]);
void place_bird(const double u[3], double x[3]);
void place_bird_raised(const double u[3], double x[3]);
void place_bird_banked(const double u[3], double x[3]); // one wing up, one down, by 50 degrees
void place_bird_diving(const double u[3], double x[3]); // body bent down, wings raised by 30
void place_fish(const double u[3], double x[3]);
void place_beast(const double u[3], double x[3]);
void place_beast_walking(const double u[3], double x[3]);   // legs moved by 40 degrees, head turned
void place_beast_rearing(const double u[3], double x[3]);   // fore part raised by 60 degrees
void place_beast_curled(const double u[3], double x[3]);    // bent sideways by 100 degrees
void place_beast_stretched(const double u[3], double x[3]); // another build

// Deformations of points in space: the bar's bend and twist.
void bend_point(const double in[3], double out[3]);
void twist_point(const double in[3], double out[3]);

typedef struct truth_pair {
  const char *name;
  test_shape from, to;
  double *truth; // (from's vertices x 3): where each belongs in `to`
  double *u;     // (from's vertices x 3): parameters; NULL where made from data/
  double *u_to;  // (to's vertices x 3)
} truth_pair;

// truth = place_to(u of from's vertices).
void pair_of_bodies(const char *name, body which, int refine_from, placement place_from,
                    int refine_to, placement place_to, int functions, truth_pair *out);
// The body's boxes as regions of the pair's meshes (column 0: from, 1: to).
void pair_regions(const truth_pair *pair, body which, ep_regions *out);
void pair_free(truth_pair *pair);
// x <- scale R x + shift for `to` and the truth; the LB space is turned along (scaled).
void pair_move(truth_pair *pair, const double axis[3], double degrees, double scale, double shift);
// Mean distance of the map's points to the truth over the diagonal of `to`. tet, weight as in
// ep_map.
double pair_error(const truth_pair *pair, const int *tet, const double *weight);
// The vertex of `from` whose position (parameters) is nearest to x (u), as a landmark with its
// truth.
ep_landmark pair_landmark(const truth_pair *pair, const double x[3]);
ep_landmark pair_landmark_of(const truth_pair *pair, const double u[3]);

#endif
