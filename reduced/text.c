#include "reduced/text.h"

#include <string.h>

void ep_text_set(char *message, const char *text) {
  if (!message) return;
  message[0] = '\0';
  ep_text_add(message, text);
}

void ep_text_add(char *message, const char *text) {
  ep_text_add_part(message, text, strlen(text));
}

void ep_text_add_part(char *message, const char *text, size_t length) {
  if (!message) return;
  size_t used = strlen(message);
  for (size_t i = 0; i < length && used + 1 < EP_MESSAGE_SIZE; i++) {
    char c = text[i];
    message[used++] = (c >= ' ' && c <= '~') ? c : '?';
  }
  message[used] = '\0';
}

void ep_text_add_number(char *message, long long number) {
  char digits[24];
  size_t at = sizeof digits;
  unsigned long long rest =
      number < 0 ? 0ULL - (unsigned long long)number : (unsigned long long)number;
  do digits[--at] = (char)('0' + rest % 10);
  while (rest /= 10);
  if (number < 0) digits[--at] = '-';
  ep_text_add_part(message, digits + at, sizeof digits - at);
}

ep_status ep_text_refuse(char *message, const char *text) {
  ep_text_set(message, text);
  return EP_ERR_FORMAT;
}
