// Running the real program from a test: its exit code, what it said, what it left.
#ifndef EP_TESTS_APP_PROGRAM_H
#define EP_TESTS_APP_PROGRAM_H

#include <jansson.h>
#include <stdbool.h>

// Run a shell line; its stdout goes to out.txt, its stderr to err.txt. Returns the exit code,
// -1 where it was killed.
int shell(const char *format, ...) __attribute__((format(printf, 1, 2)));
// The same for arguments of the program; `before` (environment, limits; may be "") stands ahead.
int program(const char *before, const char *format, ...) __attribute__((format(printf, 2, 3)));

char *text_of(const char *path); // fails the test where it cannot be read; free
// The one JSON object in out.txt.
json_t *report(void);
double number(const json_t *object, const char *key);
// Do all files of folder a whose name ends so exist in b with the same bytes? Counts them.
bool same_files(const char *a, const char *b, const char *ending, int *count);

#endif
