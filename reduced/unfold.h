// The way out of a jam. An object that was put turned over, or folded into itself, may come to rest
// where neither the material nor the parabolas of its guards lead out: their energy W has minima
// besides the rest shape. There it unfolds: until it is nearly at rest its internal energy is
//   V(q) = 2 a (sqrt(1 + y / a) - 1),   y = q^T K0 q / 2,
// convex with its only minimum at q = 0. The bend a is chosen such that V = W where unfolding
// begins, or V = y (a infinite) where y <= W. Close to rest V goes like y, and y like W; far away
// it is a cone, so that the way back is short however little energy was left. Inertia, loads and
// contact go on, and damping too, of V nearly critical at least: whatever the integrator, the
// object comes to rest and unfolding ends. Examples do not act.
//
// W is the whole internal energy: material, guards, Green strains and the example force's potential
// (all that unfolding replaces).
//
// It begins from a state whose guards have parabolas (reduced/guard.h), between steps,
//   where more than half of the guards and 8 at least are turned over and it does not race,
//   v^2 / 2 < y;
//   or where it is jammed: at the beginnings of EP_UNFOLD_CALM steps in a row it hardly moved,
//   v^2 / 2 < W / 5, and no load kept it there, |dW/dq| < |K0 q| / 5.
// It ends with all guards above their limits, nearly at rest (y at most a hundredth of V at the
// beginning; anywhere where V = y), where W <= V: neither change adds energy. Where a load keeps the
// object from rest it ends once the object is calm under it, V being softer than the material: that
// change adds W - V, and is the only one that may. It also ends where the caller writes q: then
// nothing is known of the new shape (whoever writes the velocity alone pushes an object that goes on
// unfolding). What a step reports as elastic energy is V meanwhile.
#ifndef EP_REDUCED_UNFOLD_H
#define EP_REDUCED_UNFOLD_H

#define EP_UNFOLD_CALM 12

struct ep_state;

typedef struct ep_unfold {
  int on;
  int calm;         // steps in a row that began calm
  double bend;      // a of V; 0: V = y
  double from;      // V where it began
  double viscosity; // [s] of this step: damping by viscosity K0 at least
} ep_unfold;

// V at q (r), of K0 and state->unfold; gradient g (r) and Hessian h (r x r, positive definite) are
// set unless NULL.
double ep_unfold_energy(struct ep_state *state, const double *q, double *g, double *h);

// At the beginning of a step whose guards have parabolas or that unfolds: shall it unfold? energy,
// force (r): W and dW/dq at the state's q as they are without unfolding; loaded: something outside
// acts. Returns whether it is calm; ep_unfold_end takes that where the step succeeds.
int ep_unfold_begin(struct ep_state *state, double energy, const double *force, int loaded);
void ep_unfold_end(struct ep_state *state, int calm);

// From now on the state does not unfold: what its material and its guards leave turned over stays
// to be seen (the bake looks for it).
void ep_unfold_never(struct ep_state *state);

#endif
