#include "linalg/sparse.h"

#include <limits.h>
#include <stdlib.h>
#include <string.h>

// Tets around each vertex: those of vertex i are tet[start[i]] .. tet[start[i + 1] - 1].
typedef struct incidence {
  int *start, *tet;
} incidence;

static void incidence_free(incidence *inc) {
  free(inc->start);
  free(inc->tet);
}

static ep_status incidence_make(int nv, int nt, const int *tets, incidence *inc, ep_error *err) {
  inc->start = calloc((size_t)nv + 2, sizeof *inc->start);
  inc->tet = malloc(4 * (size_t)nt * sizeof *inc->tet + 1);
  if (!inc->start || !inc->tet) return ep_fail(err, EP_ERR_MEMORY, "no memory for %d tets", nt);
  int *cursor = inc->start + 1; // becomes the end of each list while they are filled
  for (int i = 0; i < 4 * nt; i++) {
    if (tets[i] < 0 || tets[i] >= nv)
      return ep_fail(err, EP_ERR_ARGUMENT, "tet %d names vertex %d, but there are %d vertices",
                     i / 4, tets[i], nv);
    cursor[tets[i] + 1]++;
  }
  for (int i = 0; i < nv; i++) cursor[i + 1] += cursor[i];
  for (int i = 0; i < 4 * nt; i++) inc->tet[cursor[tets[i]]++] = i / 4;
  return EP_OK;
}

static int compare_int(const void *a, const void *b) {
  const int x = *(const int *)a, y = *(const int *)b;
  return (x > y) - (x < y);
}

// Neighbours of vertex i (itself included, if any tet has it) into list, in ascending order where
// sorted; mark[j] == i says that j is already in. Returns their number.
static int neighbours(const incidence *inc, const int *tets, int i, int *mark, int *list,
                      int sorted) {
  int count = 0;
  for (int t = inc->start[i]; t < inc->start[i + 1]; t++)
    for (int c = 0; c < 4; c++) {
      const int j = tets[4 * inc->tet[t] + c];
      if (mark[j] == i) continue;
      mark[j] = i;
      list[count++] = j;
    }
  if (sorted) qsort(list, (size_t)count, sizeof *list, compare_int);
  return count;
}

static void unmark(int *mark, int nv) {
  for (int i = 0; i < nv; i++) mark[i] = -1;
}

// Row starts of the block matrix. Fails where its entries cannot be counted in an int.
static ep_status count_rows(int nv, const int *tets, const incidence *inc, int block, int *mark,
                            int *list, ep_csr *out, ep_error *err) {
  long long total = 0;
  unmark(mark, nv);
  for (int i = 0; i < nv; i++) {
    const int width = block * neighbours(inc, tets, i, mark, list, 0);
    if (total + (long long)block * width > INT_MAX)
      return ep_fail(err, EP_ERR_UNSUPPORTED,
                     "matrix of %d vertices has 2^31 entries or more; use a coarser mesh", nv);
    for (int a = 0; a < block; a++, total += width) out->start[block * i + a] = (int)total;
  }
  out->start[out->n] = (int)total;
  return EP_OK;
}

static void fill_rows(int nv, const int *tets, const incidence *inc, int block, int *mark,
                      int *list, ep_csr *out) {
  unmark(mark, nv);
  for (int i = 0; i < nv; i++) {
    const int count = neighbours(inc, tets, i, mark, list, 1);
    for (int a = 0; a < block; a++) {
      int *column = out->column + out->start[block * i + a];
      for (int c = 0; c < count; c++)
        for (int b = 0; b < block; b++) column[block * c + b] = block * list[c] + b;
    }
  }
}

ep_status ep_csr_from_tets(int nv, int nt, const int *tets, int block, ep_csr *out, ep_error *err) {
  memset(out, 0, sizeof *out);
  if (nv < 1 || nt < 0 || block < 1 || nv > INT_MAX / block - 1 || nt > INT_MAX / 4)
    return ep_fail(err, EP_ERR_ARGUMENT, "no matrix pattern for %d vertices, %d tets, blocks of %d",
                   nv, nt, block);
  incidence inc = {0};
  int *mark = malloc((size_t)nv * sizeof *mark), *list = malloc((size_t)nv * sizeof *list);
  out->n = block * nv;
  out->start = malloc(((size_t)out->n + 1) * sizeof *out->start);
  ep_status status = EP_OK;
  if (!mark || !list || !out->start) {
    status = ep_fail(err, EP_ERR_MEMORY, "no memory for the pattern of %d vertices", nv);
    goto done;
  }
  EP_TRY_GOTO(status, incidence_make(nv, nt, tets, &inc, err), done);
  EP_TRY_GOTO(status, count_rows(nv, tets, &inc, block, mark, list, out, err), done);
  const size_t entries = (size_t)out->start[out->n];
  out->column = malloc(entries * sizeof *out->column + 1);
  out->value = calloc(entries + 1, sizeof *out->value);
  if (!out->column || !out->value) {
    status = ep_fail(err, EP_ERR_MEMORY, "no memory for %zu matrix entries", entries);
    goto done;
  }
  fill_rows(nv, tets, &inc, block, mark, list, out);
done:
  incidence_free(&inc);
  free(mark);
  free(list);
  if (status != EP_OK) ep_csr_free(out);
  return status;
}

void ep_csr_free(ep_csr *a) {
  free(a->start);
  free(a->column);
  free(a->value);
  memset(a, 0, sizeof *a);
}

int ep_csr_find(const ep_csr *a, int i, int j) {
  int low = a->start[i], high = a->start[i + 1] - 1;
  while (low <= high) {
    const int middle = low + (high - low) / 2;
    if (a->column[middle] == j) return middle;
    if (a->column[middle] < j)
      low = middle + 1;
    else
      high = middle - 1;
  }
  return -1;
}

static void multiply_scalar(const ep_csr *a, const double *restrict x, double *restrict y) {
  for (int i = 0; i < a->n; i++) {
    double sum = 0;
    for (int p = a->start[i]; p < a->start[i + 1]; p++) sum += a->value[p] * x[a->column[p]];
    y[i] = sum;
  }
}

void ep_csr_multiply(const ep_csr *a, int width, const double *x, double *y) {
  if (width == 1) {
    multiply_scalar(a, x, y);
    return;
  }
  for (int i = 0; i < a->n; i++) {
    double *row = y + (size_t)i * (size_t)width;
    for (int c = 0; c < width; c++) row[c] = 0;
    for (int p = a->start[i]; p < a->start[i + 1]; p++) {
      const double *from = x + (size_t)a->column[p] * (size_t)width;
      for (int c = 0; c < width; c++) row[c] += a->value[p] * from[c];
    }
  }
}
