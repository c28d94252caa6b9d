// Guards: elements that do nothing until they are nearly flat, and then resist. The volume penalty
// of the material acts at the cubature elements alone; the others can turn over unseen. The bake
// finds which do (cubature/guards.h) and adds them here.
//
//   W_g = sum_e w_e k_e b(J_e / limit_e),   b(x) = -(x - 1)^2 log x  below 1, 0 above
// (the barrier of Li et al. 2020, "Incremental Potential Contact", eq. 6), continued below
// x = EP_GUARD_FLOOR by its parabola there: C2 everywhere. The wall stands whatever relief, alpha
// and strength say: it is no part of the material's resistance.
//
// A wall also stands in the way back: an object that is put turned over would stay jammed between
// walls. So a step that begins with a guard turned over (J < 0) has parabolas in their place,
// s k (J - limit)^2 / 2, and so have those after it until every guard
// is above its limit: there both are zero, so the change back adds no energy; the change to
// parabolas takes some away.
//
// Where the object jams all the same it unfolds: reduced/unfold.h.
//
// What is far from its limit is not looked at: of every group of 8 guards the state remembers where
// it was looked at last, q_0, and how far F may go from there before any of the group can reach its
// limit. |F - F_0| <= sum_a |q_a - q_0a| growth_a, and
//   det(F_0 + D) >= J_0 - |cof F_0| d - |F_0| d^2 / sqrt 3 - d^3 / (3 sqrt 3),   d = |D|.
// While nothing was near a limit where all groups were looked over last, q_h, one such sum with the
// largest growth of all groups, from q_h, stands for all of them: most evaluations cost O(r).
// Groups passed over would have added exact zeros: results do not depend on what was remembered.
#ifndef EP_REDUCED_GUARD_H
#define EP_REDUCED_GUARD_H

// Share of the limit below which the wall goes on as a parabola.
#define EP_GUARD_FLOOR 0.02

// k = this times max(lambda, mu), as in the material's own penalty, 10 max(lambda, mu) (J - 0.5)^2
// / 2. With a limit of 0.15 the wall has less force than it above x = 0.87, 41 times as much at
// x = 1 / 3: it begins softly and is not passed.
#define EP_GUARD_STIFFNESS 10.0

// s: a fifth of the material's own penalty. As strong as it, parabolas of many guards jam too.
#define EP_GUARD_SOFTNESS 0.2

// Of one guard: its k, of its element's Lame constants [Pa]; and what its dF/dq, g (9 x r), makes
// of the growth (r, in and out) of its group: no less than any |G_a|_F of it.
double ep_guard_stiffness(double lambda, double mu);
void ep_guard_add_growth(int r, const double *g, double *growth);

struct ep_state;

// A state that never looked.
void ep_guard_init(struct ep_state *state);

// At the beginning of a step from state->q: walls or parabolas.
void ep_guard_begin(struct ep_state *state);

// W_g at q (r), with the parabolas where the last step had them; its gradient and Hessian are added
// to f (r) and h (r x r, both triangles) unless NULL. project != 0: element tangents projected to
// positive semidefinite. 0 without guards.
double ep_guard_add(struct ep_state *state, const double *q, double *f, double *h, int project);

#endif
