#include <float.h>
#include <stdlib.h>
#include <string.h>

#include "align/private.h"

enum { LEAF = 8, LANES = 4, COORDINATES_MAX = 1024 };

typedef struct node {
  int first, count; // points of the node in tree order
  int left, right;  // children, -1 in a leaf
} node;

struct ep_tree {
  int n, d, stride; // stride: d rounded up to LANES, padded with zeros
  int nodes;
  node *node;
  double *box;   // (nodes x 2 x stride) low, then high corner
  double *point; // (n x stride) in tree order
  int *index;    // (n) tree order -> caller's index
  int *place;    // (n) caller's index -> tree order
};

void ep_tree_free(ep_tree *tree) {
  if (!tree) return;
  free(tree->node);
  free(tree->box);
  free(tree->point);
  free(tree->index);
  free(tree->place);
  free(tree);
}

static void set_box(ep_tree *tree, int which, const double *points) {
  const node *at = &tree->node[which];
  double *low = tree->box + (size_t)which * 2 * tree->stride, *high = low + tree->stride;
  for (int c = 0; c < tree->d; c++) {
    low[c] = DBL_MAX;
    high[c] = -DBL_MAX;
  }
  for (int i = at->first; i < at->first + at->count; i++) {
    const double *p = points + (size_t)tree->index[i] * tree->d;
    for (int c = 0; c < tree->d; c++) {
      if (p[c] < low[c]) low[c] = p[c];
      if (p[c] > high[c]) high[c] = p[c];
    }
  }
}

static int widest(const ep_tree *tree, int which) {
  const double *low = tree->box + (size_t)which * 2 * tree->stride, *high = low + tree->stride;
  int axis = 0;
  for (int c = 1; c < tree->d; c++)
    if (high[c] - low[c] > high[axis] - low[axis]) axis = c;
  return axis;
}

// Order by coordinate, then by index: equal coordinates still give one order.
static int before(const double *points, int d, int axis, int a, int b) {
  const double x = points[(size_t)a * d + axis], y = points[(size_t)b * d + axis];
  return x < y || (x == y && a < b);
}

// Quickselect: the `middle` smallest of index[0..count) come first.
static void split(const double *points, int d, int axis, int *index, int count, int middle) {
  int low = 0, high = count - 1;
  while (low < high) {
    const int pivot = index[low + (high - low) / 2];
    int i = low, j = high;
    while (i <= j) {
      while (before(points, d, axis, index[i], pivot)) i++;
      while (before(points, d, axis, pivot, index[j])) j--;
      if (i <= j) {
        const int t = index[i];
        index[i++] = index[j];
        index[j--] = t;
      }
    }
    if (middle <= j)
      high = j;
    else if (middle >= i)
      low = i;
    else
      return;
  }
}

// Breadth first: children are appended while nodes are worked off.
static void grow(ep_tree *tree, const double *points) {
  tree->node[0] = (node){0, tree->n, -1, -1};
  tree->nodes = 1;
  for (int which = 0; which < tree->nodes; which++) {
    node *at = &tree->node[which];
    set_box(tree, which, points);
    if (at->count <= LEAF) continue;
    const int half = at->count / 2;
    split(points, tree->d, widest(tree, which), tree->index + at->first, at->count, half);
    at->left = tree->nodes++;
    at->right = tree->nodes++;
    tree->node[at->left] = (node){at->first, half, -1, -1};
    tree->node[at->right] = (node){at->first + half, at->count - half, -1, -1};
  }
}

ep_status ep_tree_make(int n, int d, const double *points, ep_tree **out, ep_error *err) {
  *out = NULL;
  if (n < 1 || d < 1 || d > COORDINATES_MAX)
    return ep_fail(err, EP_ERR_ARGUMENT,
                   "nearest neighbours among %d points of %d coordinates (at most %d)", n, d,
                   COORDINATES_MAX);
  ep_tree *tree = calloc(1, sizeof *tree);
  if (!tree) return ep_fail(err, EP_ERR_MEMORY, "no memory for a tree of %d points", n);
  tree->n = n;
  tree->d = d;
  tree->stride = (d + LANES - 1) / LANES * LANES;
  // Halving stops at LEAF, so leaves hold more than LEAF/2 points and there are < 4 n / LEAF nodes.
  const size_t most = 4 * (size_t)n / LEAF + 2;
  tree->node = malloc(most * sizeof *tree->node);
  tree->box = calloc(most * 2 * (size_t)tree->stride, sizeof *tree->box);
  tree->point = calloc((size_t)n * tree->stride, sizeof *tree->point);
  tree->index = malloc((size_t)n * sizeof *tree->index);
  tree->place = malloc((size_t)n * sizeof *tree->place);
  if (!tree->node || !tree->box || !tree->point || !tree->index || !tree->place) {
    ep_tree_free(tree);
    return ep_fail(err, EP_ERR_MEMORY, "no memory for a tree of %d points", n);
  }
  for (int i = 0; i < n; i++) tree->index[i] = i;
  grow(tree, points);
  for (int i = 0; i < n; i++) {
    tree->place[tree->index[i]] = i;
    memcpy(tree->point + (size_t)i * tree->stride, points + (size_t)tree->index[i] * d,
           (size_t)d * sizeof(double));
  }
  *out = tree;
  return EP_OK;
}

// Squared distance, or some number above `bound` once that is certain.
static double distance2(const double *a, const double *b, int stride, double bound) {
  double sum[LANES] = {0};
  double total = 0;
  for (int c = 0; c < stride; c += LANES) {
    for (int l = 0; l < LANES; l++) {
      const double t = a[c + l] - b[c + l];
      sum[l] += t * t;
    }
    total = (sum[0] + sum[1]) + (sum[2] + sum[3]);
    if (total > bound) return total;
  }
  return total;
}

static double box_distance2(const double *q, const double *low, int stride, double bound) {
  const double *high = low + stride;
  double sum[LANES] = {0};
  double total = 0;
  for (int c = 0; c < stride; c += LANES) {
    for (int l = 0; l < LANES; l++) {
      const double under = low[c + l] - q[c + l], over = q[c + l] - high[c + l];
      double t = under > over ? under : over;
      t = t > 0 ? t : 0;
      sum[l] += t * t;
    }
    total = (sum[0] + sum[1]) + (sum[2] + sum[3]);
    if (total > bound) return total;
  }
  return total;
}

typedef struct search {
  const ep_tree *tree;
  const double *q;
  double best;
  int nearest; // caller's index, -1 while none
} search;

static void visit_leaf(search *s, const node *at) {
  const ep_tree *tree = s->tree;
  for (int i = at->first; i < at->first + at->count; i++) {
    const double d2 =
        distance2(s->q, tree->point + (size_t)i * tree->stride, tree->stride, s->best);
    const int index = tree->index[i];
    if (d2 < s->best || (d2 == s->best && (s->nearest < 0 || index < s->nearest))) {
      s->best = d2;
      s->nearest = index;
    }
  }
}

// The bound of a box never exceeds the computed distance of a point inside: both are sums of the
// same monotone terms in the same order. So a box is left out only when its bound is truly greater.
static void visit(search *s, int which) {
  const ep_tree *tree = s->tree;
  const node *at = &tree->node[which];
  if (at->left < 0) {
    visit_leaf(s, at);
    return;
  }
  const size_t corners = 2 * (size_t)tree->stride;
  const double l = box_distance2(s->q, tree->box + at->left * corners, tree->stride, s->best);
  const double r = box_distance2(s->q, tree->box + at->right * corners, tree->stride, s->best);
  const int near = l <= r ? at->left : at->right, far = l <= r ? at->right : at->left;
  if ((l <= r ? l : r) <= s->best) visit(s, near);
  if ((l <= r ? r : l) <= s->best) visit(s, far);
}

void ep_tree_nearest(const ep_tree *tree, int count, const double *queries, int *nearest) {
  double padded[COORDINATES_MAX] = {0};
  for (int i = 0; i < count; i++) {
    search s = {tree, queries + (size_t)i * tree->d, DBL_MAX, -1};
    if (tree->stride != tree->d) {
      memcpy(padded, s.q, (size_t)tree->d * sizeof(double));
      s.q = padded;
    }
    if (nearest[i] >= 0 && nearest[i] < tree->n) {
      s.nearest = nearest[i];
      s.best = distance2(s.q, tree->point + (size_t)tree->place[s.nearest] * tree->stride,
                         tree->stride, DBL_MAX);
    }
    visit(&s, 0);
    nearest[i] = s.nearest;
  }
}
