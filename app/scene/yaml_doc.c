#include "app/scene/yaml_doc.h"

#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

enum { KEY_MAX = 256, DEPTH_MAX = 32, CHUNK = 4096 };

// Whether character `at` of the text is a tab. libyaml counts characters, not bytes; a byte order
// mark is none of them.
static bool is_tab(const char *text, size_t size, size_t at) {
  const bool marked = size >= 3 && memcmp(text, "\xef\xbb\xbf", 3) == 0;
  for (size_t i = marked ? 3 : 0; i < size; i++) {
    const bool begins = ((unsigned char)text[i] & 0xc0) != 0x80; // else inside a UTF-8 character
    if (begins && at-- == 0) return text[i] == '\t';
  }
  return false;
}

static int line_of(const char *text, size_t size, size_t offset) {
  int line = 1;
  for (size_t i = 0; i < size && i < offset; i++) line += text[i] == '\n';
  return line;
}

static ep_status syntax_error(const yaml_parser_t *parser, const char *name, const char *text,
                              size_t size, ep_error *err) {
  const char *problem = parser->problem ? parser->problem : "not YAML";
  if (parser->error == YAML_READER_ERROR) // its place is an offset in bytes
    return ep_fail(err, EP_ERR_SCENE, "%s:%d: %s; a scene is saved as UTF-8", name,
                   line_of(text, size, parser->problem_offset), problem);
  if (is_tab(text, size, parser->problem_mark.index)) problem = "a tab: YAML is indented by blanks";
  return ep_fail(err, EP_ERR_SCENE, "%s:%zu:%zu: %s", name, parser->problem_mark.line + 1,
                 parser->problem_mark.column + 1, problem);
}

// Load the one document of a text; *root tells whether it is empty.
static ep_status load_one(const char *name, const char *text, size_t size,
                          yaml_document_t *document, ep_error *err) {
  yaml_parser_t parser;
  if (!yaml_parser_initialize(&parser))
    return ep_fail(err, EP_ERR_MEMORY, "%s: no memory for the YAML parser", name);
  yaml_parser_set_input_string(&parser, (const unsigned char *)text, size);
  ep_status status = EP_OK;
  if (!yaml_parser_load(&parser, document)) {
    status = syntax_error(&parser, name, text, size, err);
  } else {
    yaml_document_t second;
    if (!yaml_parser_load(&parser, &second)) {
      status = syntax_error(&parser, name, text, size, err);
    } else {
      if (yaml_document_get_root_node(&second))
        status =
            ep_fail(err, EP_ERR_SCENE, "%s: more than one YAML document; keep the first", name);
      yaml_document_delete(&second);
    }
    if (status != EP_OK) yaml_document_delete(document);
  }
  yaml_parser_delete(&parser);
  return status;
}

static bool scalar_is(const yaml_node_t *node, const char *text, size_t length) {
  return node && node->type == YAML_SCALAR_NODE && node->data.scalar.length == length &&
         memcmp(node->data.scalar.value, text, length) == 0;
}

static ep_status refuse_double_keys(ep_yaml *yaml, yaml_node_t *node, ep_error *err) {
  const yaml_node_pair_t *first = node->data.mapping.pairs.start;
  for (const yaml_node_pair_t *a = first; a < node->data.mapping.pairs.top; a++) {
    const yaml_node_t *key = yaml_document_get_node(&yaml->document, a->key);
    if (!key || key->type != YAML_SCALAR_NODE)
      return ep_fail(err, EP_ERR_SCENE, "%s:%zu:%zu: a key must be a plain word", yaml->name,
                     node->start_mark.line + 1, node->start_mark.column + 1);
    for (const yaml_node_pair_t *b = first; b < a; b++)
      if (scalar_is(yaml_document_get_node(&yaml->document, b->key),
                    (const char *)key->data.scalar.value, key->data.scalar.length))
        return ep_fail(err, EP_ERR_SCENE, "%s:%zu:%zu: key '%.100s' is given twice", yaml->name,
                       key->start_mark.line + 1, key->start_mark.column + 1,
                       (const char *)key->data.scalar.value);
  }
  return EP_OK;
}

ep_status ep_yaml_parse(const char *name, const char *text, size_t size, ep_yaml *out,
                        ep_error *err) {
  memset(out, 0, sizeof *out);
  EP_TRY(load_one(name, text, size, &out->document, err));
  out->name = name;
  ep_status status = EP_OK;
  const yaml_node_t *root = yaml_document_get_root_node(&out->document);
  if (!root)
    status = ep_fail(err, EP_ERR_SCENE, "%s: empty file, a scene was expected", name);
  else if (root->type != YAML_MAPPING_NODE)
    status = ep_fail(err, EP_ERR_SCENE, "%s:1:1: a scene is a mapping (key: value lines)", name);
  yaml_node_t *node = out->document.nodes.start;
  for (; status == EP_OK && node < out->document.nodes.top; node++)
    if (node->type == YAML_MAPPING_NODE) status = refuse_double_keys(out, node, err);
  if (status != EP_OK) ep_yaml_free(out);
  return status;
}

void ep_yaml_free(ep_yaml *yaml) {
  yaml_document_delete(&yaml->document);
  memset(yaml, 0, sizeof *yaml);
}

// ---- paths -----------------------------------------------------------------------------------

// Cut the next component off a dotted path. False at the end.
static bool next_component(const char **path, char *component) {
  if (!**path) return false;
  const size_t length = strcspn(*path, ".");
  const size_t kept = length < KEY_MAX - 1 ? length : KEY_MAX - 1;
  memcpy(component, *path, kept);
  component[kept] = '\0';
  *path += length;
  if (**path == '.') (*path)++;
  return true;
}

static yaml_node_pair_t *find_pair(yaml_document_t *document, const yaml_node_t *node,
                                   const char *key) {
  yaml_node_pair_t *pair = node->data.mapping.pairs.start;
  for (; pair < node->data.mapping.pairs.top; pair++)
    if (scalar_is(yaml_document_get_node(document, pair->key), key, strlen(key))) return pair;
  return NULL;
}

// The number a list index says, -1 where it is none.
static long index_of(const char *component) {
  char *end;
  const long index = strtol(component, &end, 10);
  return component[0] >= '0' && component[0] <= '9' && *end == '\0' ? index : -1;
}

// The node number of a child, 0 where there is none.
static int child(yaml_document_t *document, const yaml_node_t *node, const char *component) {
  if (node->type == YAML_MAPPING_NODE) {
    const yaml_node_pair_t *pair = find_pair(document, node, component);
    return pair ? pair->value : 0;
  }
  if (node->type != YAML_SEQUENCE_NODE) return 0;
  const long index = index_of(component);
  const long count = node->data.sequence.items.top - node->data.sequence.items.start;
  return index >= 0 && index < count ? node->data.sequence.items.start[index] : 0;
}

int ep_yaml_locate(ep_yaml *yaml, const char *path, int *line, int *column) {
  char component[KEY_MAX];
  const yaml_node_t *node = yaml_document_get_root_node(&yaml->document);
  int found = 1;
  while (node && next_component(&path, component)) {
    const int next = child(&yaml->document, node, component);
    if (!next) {
      found = 0;
      break;
    }
    node = yaml_document_get_node(&yaml->document, next);
  }
  *line = node ? (int)node->start_mark.line + 1 : 1;
  *column = node ? (int)node->start_mark.column + 1 : 1;
  return node ? found : 0;
}

static bool before(int line_a, int column_a, int line_b, int column_b) {
  return line_a < line_b || (line_a == line_b && column_a < column_b);
}

int ep_yaml_find_key(ep_yaml *yaml, const char *key, int *line, int *column) {
  int best_line = 0, best_column = 0;
  const yaml_node_t *node = yaml->document.nodes.start;
  for (; node < yaml->document.nodes.top; node++) {
    if (node->type != YAML_MAPPING_NODE) continue;
    const yaml_node_pair_t *pair = find_pair(&yaml->document, node, key);
    if (!pair) continue;
    const yaml_node_t *found = yaml_document_get_node(&yaml->document, pair->key);
    const int at = (int)found->start_mark.line + 1, in = (int)found->start_mark.column + 1;
    if (before(at, in, *line, *column)) continue;
    if (best_line && !before(at, in, best_line, best_column)) continue;
    best_line = at;
    best_column = in;
  }
  if (!best_line) return 0;
  *line = best_line;
  *column = best_column;
  return 1;
}

// ---- overrides -------------------------------------------------------------------------------

// Copy node `from` of another document; returns its new number, 0 without memory or too deep.
static int copy_node(yaml_document_t *to, yaml_document_t *from, int number, int depth) {
  const yaml_node_t *node = yaml_document_get_node(from, number);
  if (!node || depth > DEPTH_MAX) return 0;
  if (node->type == YAML_SCALAR_NODE)
    return yaml_document_add_scalar(to, NULL, node->data.scalar.value,
                                    (int)node->data.scalar.length, node->data.scalar.style);
  if (node->type == YAML_SEQUENCE_NODE) {
    const int made = yaml_document_add_sequence(to, NULL, YAML_FLOW_SEQUENCE_STYLE);
    const yaml_node_item_t *item = node->data.sequence.items.start;
    for (; made && item < node->data.sequence.items.top; item++) {
      const int entry = copy_node(to, from, *item, depth + 1);
      if (!entry || !yaml_document_append_sequence_item(to, made, entry)) return 0;
    }
    return made;
  }
  const int made = yaml_document_add_mapping(to, NULL, YAML_FLOW_MAPPING_STYLE);
  const yaml_node_pair_t *pair = node->data.mapping.pairs.start;
  for (; made && pair < node->data.mapping.pairs.top; pair++) {
    const int key = copy_node(to, from, pair->key, depth + 1);
    const int value = copy_node(to, from, pair->value, depth + 1);
    if (!key || !value || !yaml_document_append_mapping_pair(to, made, key, value)) return 0;
  }
  return made;
}

static ep_status no_memory(ep_error *err) {
  return ep_fail(err, EP_ERR_MEMORY, "no memory for --set");
}

static int add_text(ep_yaml *yaml, const char *text) {
  return yaml_document_add_scalar(&yaml->document, NULL, (const yaml_char_t *)text,
                                  (int)strlen(text), YAML_ANY_SCALAR_STYLE);
}

// Put node `value` at `component` of node `parent` (numbers), replacing what is there.
static ep_status attach(ep_yaml *yaml, int parent, const char *component, int value,
                        const char *assignment, ep_error *err) {
  yaml_node_t *node = yaml_document_get_node(&yaml->document, parent);
  if (node->type == YAML_MAPPING_NODE) {
    yaml_node_pair_t *pair = find_pair(&yaml->document, node, component);
    if (pair) {
      pair->value = value;
      return EP_OK;
    }
    const int key = add_text(yaml, component);
    if (!key || !yaml_document_append_mapping_pair(&yaml->document, parent, key, value))
      return no_memory(err);
    return EP_OK;
  }
  if (node->type != YAML_SEQUENCE_NODE)
    return ep_fail(err, EP_ERR_SCENE, "--set %s: '%s' lies inside a plain value", assignment,
                   component);
  const long index = index_of(component);
  const long count = node->data.sequence.items.top - node->data.sequence.items.start;
  if (index < 0 || index > count)
    return ep_fail(err, EP_ERR_SCENE, "--set %s: '%s' is no place in a list of %ld (use 0 to %ld)",
                   assignment, component, count, count);
  if (index < count) {
    node->data.sequence.items.start[index] = value;
    return EP_OK;
  }
  return yaml_document_append_sequence_item(&yaml->document, parent, value) ? EP_OK
                                                                            : no_memory(err);
}

// Walk to the parent of the last component (copied to last), making mappings where none stand.
static ep_status walk(ep_yaml *yaml, const char *path, const char *assignment, int *parent,
                      char *last, ep_error *err) {
  char component[KEY_MAX];
  *parent = 1; // the root is the first node
  next_component(&path, last);
  while (next_component(&path, component)) {
    int next = child(&yaml->document, yaml_document_get_node(&yaml->document, *parent), last);
    if (!next) {
      // What comes next tells what is missing: "fixed.0=..." makes a list.
      next = index_of(component) >= 0
                 ? yaml_document_add_sequence(&yaml->document, NULL, YAML_FLOW_SEQUENCE_STYLE)
                 : yaml_document_add_mapping(&yaml->document, NULL, YAML_FLOW_MAPPING_STYLE);
      if (!next) return no_memory(err);
      EP_TRY(attach(yaml, *parent, last, next, assignment, err));
    }
    *parent = next;
    memcpy(last, component, sizeof component);
  }
  return EP_OK;
}

ep_status ep_yaml_set(ep_yaml *yaml, const char *assignment, ep_error *err) {
  const char *equals = strchr(assignment, '=');
  char path[KEY_MAX], last[KEY_MAX];
  const size_t length = equals ? (size_t)(equals - assignment) : 0;
  if (length == 0 || length >= sizeof path || assignment[0] == '.' || equals[-1] == '.')
    return ep_fail(err, EP_ERR_SCENE, "--set %.200s: expected key=value, e.g. reduction.modes=20",
                   assignment);
  memcpy(path, assignment, length);
  path[length] = '\0';
  yaml_document_t value;
  ep_status status = load_one("--set", equals + 1, strlen(equals + 1), &value, err);
  if (status != EP_OK) return ep_fail_context(err, "--set %.200s", assignment);
  int parent = 0, made = 0;
  if (!yaml_document_get_root_node(&value))
    made = add_text(yaml, "");
  else
    made = copy_node(&yaml->document, &value, 1, 0);
  status =
      made ? walk(yaml, path, assignment, &parent, last, err)
           : ep_fail(err, EP_ERR_SCENE, "--set %.200s: the value is nested too deeply", assignment);
  if (status == EP_OK) status = attach(yaml, parent, last, made, assignment, err);
  yaml_document_delete(&value);
  return status;
}

// ---- printing --------------------------------------------------------------------------------

typedef struct text_buffer {
  char *text;
  size_t size, capacity;
} text_buffer;

static int append(void *user, unsigned char *bytes, size_t size) {
  text_buffer *buffer = user;
  if (buffer->size + size + 1 > buffer->capacity) {
    const size_t capacity = 2 * (buffer->size + size) + CHUNK;
    char *larger = realloc(buffer->text, capacity);
    if (!larger) return 0;
    buffer->text = larger;
    buffer->capacity = capacity;
  }
  memcpy(buffer->text + buffer->size, bytes, size);
  buffer->size += size;
  buffer->text[buffer->size] = '\0';
  return 1;
}

ep_status ep_yaml_print(ep_yaml *yaml, char **text, size_t *size, ep_error *err) {
  yaml_emitter_t emitter;
  text_buffer buffer = {0};
  *text = NULL;
  *size = 0;
  if (!yaml_emitter_initialize(&emitter)) return no_memory(err);
  yaml_emitter_set_output(&emitter, append, &buffer);
  yaml_emitter_set_unicode(&emitter, 1);
  const int good = yaml_emitter_open(&emitter) && yaml_emitter_dump(&emitter, &yaml->document) &&
                   yaml_emitter_close(&emitter);
  memset(&yaml->document, 0, sizeof yaml->document); // dump has deleted it
  yaml_emitter_delete(&emitter);
  if (!good || !buffer.text) {
    free(buffer.text);
    return no_memory(err);
  }
  *text = buffer.text;
  *size = buffer.size;
  return EP_OK;
}
