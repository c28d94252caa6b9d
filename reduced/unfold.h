// The way out of a jam. An object that was put turned over, or folded into itself, may come to rest
// where neither the material nor the parabolas of its guards lead out: their energy W has minima
// besides the rest shape. There it unfolds: until it is nearly at rest its internal energy is
//   V(q) = slope y + (1 - slope) well y / (well + y),   y = q^T K0 q / 2,
// which rises with y and so has no minimum but q = 0. slope is chosen such that V = W (or V < W)
// where unfolding begins, and it ends where W <= V: no change of stage adds energy. well is a
// hundredth of W at the beginning: close to rest V goes like y, and y like W. Examples do not act
// meanwhile; inertia, damping, loads and contact do.
//
// It begins from a state whose guards have parabolas (reduced/guard.h), between steps,
//   where more than half of the guards are turned over and it does not race, v^2 / 2 < y;
//   or where it is jammed: at the beginnings of EP_UNFOLD_CALM steps in a row it hardly moved,
//   v^2 / 2 < W / 5, and no load kept it there, |dW/dq| < |K0 q| / 5.
// It ends also where a load holds the object calmly with all guards above their limits. What a step
// reports as elastic energy is V meanwhile.
#ifndef EP_REDUCED_UNFOLD_H
#define EP_REDUCED_UNFOLD_H

#define EP_UNFOLD_CALM 12

struct ep_state;

typedef struct ep_unfold {
  int on;
  int calm;           // steps in a row that began calm
  double well, slope; // of V; well 0: V = y
  double from;        // W where it began
} ep_unfold;

// V at q (r), of K0 and state->unfold; gradient g (r) and Hessian h (r x r) are set unless NULL;
// project != 0: h positive semidefinite.
double ep_unfold_energy(struct ep_state *state, const double *q, double *g, double *h, int project);

// At the beginning of a step whose guards have parabolas or that unfolds: shall it unfold? energy,
// force (r): W and dW/dq at the state's q; loaded: something outside acts. Returns whether it is
// calm; ep_unfold_end takes that where the step succeeds.
int ep_unfold_begin(struct ep_state *state, double energy, const double *force, int loaded);
void ep_unfold_end(struct ep_state *state, int calm);

#endif
