#include "base/forest.h"

void ep_forest_start(int *parent, int count) {
  for (int i = 0; i < count; i++) parent[i] = i;
}

int ep_forest_root(int *parent, int i) {
  while (parent[i] != i) i = parent[i] = parent[parent[i]];
  return i;
}

bool ep_forest_join(int *parent, int a, int b) {
  a = ep_forest_root(parent, a), b = ep_forest_root(parent, b);
  if (a < b) parent[b] = a;
  if (b < a) parent[a] = b;
  return a != b;
}
