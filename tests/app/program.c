#include "program.h"

#include <dirent.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/wait.h>
// clang-format off
#include <cmocka.h>
// clang-format on

#include "base/files.h"

static int run_line(const char *line) {
  char whole[8192];
  const int used = snprintf(whole, sizeof whole, "( %s ) >out.txt 2>err.txt", line);
  if (used < 0 || (size_t)used >= sizeof whole) fail_msg("line too long: %.60s", line);
  const int status = system(whole);
  return WIFEXITED(status) && WEXITSTATUS(status) < 128 ? WEXITSTATUS(status) : -1;
}

int shell(const char *format, ...) {
  char line[8000];
  va_list args;
  va_start(args, format);
  vsnprintf(line, sizeof line, format, args);
  va_end(args);
  return run_line(line);
}

int program(const char *before, const char *format, ...) {
  char line[8000];
  const int used = snprintf(line, sizeof line, "%s %s ", before, EP_COMMAND);
  va_list args;
  va_start(args, format);
  vsnprintf(line + used, sizeof line - (size_t)used, format, args);
  va_end(args);
  return run_line(line);
}

char *text_of(const char *path) {
  char *text;
  size_t size;
  ep_error err = {0};
  if (ep_file_read(path, &text, &size, &err) != EP_OK) fail_msg("%s", err.text);
  return text;
}

json_t *report(void) {
  json_error_t trouble;
  json_t *root = json_load_file("out.txt", 0, &trouble); // refuses anything after the object
  if (!root) fail_msg("stdout is no JSON object: %s\n%s", trouble.text, text_of("err.txt"));
  return root;
}

double number(const json_t *object, const char *key) {
  const json_t *value = json_object_get(object, key);
  if (!json_is_number(value)) fail_msg("no number '%s'", key);
  return json_number_value(value);
}

static bool ends_with(const char *text, const char *ending) {
  const size_t a = strlen(text), b = strlen(ending);
  return a >= b && strcmp(text + a - b, ending) == 0;
}

bool same_files(const char *a, const char *b, const char *ending, int *count) {
  DIR *folder = opendir(a);
  if (!folder) fail_msg("no folder %s", a);
  bool same = true;
  *count = 0;
  for (struct dirent *entry; (entry = readdir(folder));) {
    char one[1024], two[1024];
    if (!ends_with(entry->d_name, ending)) continue;
    ++*count;
    snprintf(one, sizeof one, "%s/%s", a, entry->d_name);
    snprintf(two, sizeof two, "%s/%s", b, entry->d_name);
    ep_digest first, second;
    ep_error err = {0};
    same = same && ep_hash_file(one, &first, &err) == EP_OK &&
           ep_hash_file(two, &second, &err) == EP_OK && strcmp(first.hex, second.hex) == 0;
  }
  closedir(folder);
  return same;
}
