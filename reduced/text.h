// Messages without stdio: text and whole numbers appended to a buffer of fixed size. Private.
#ifndef EP_REDUCED_TEXT_H
#define EP_REDUCED_TEXT_H

#include <stddef.h>

#include "base/status.h"

enum { EP_MESSAGE_SIZE = 256 };

// message: NULL (nothing happens) or EP_MESSAGE_SIZE bytes holding a string; cut when full.
void ep_text_set(char *message, const char *text);
void ep_text_add(char *message, const char *text);
void ep_text_add_part(char *message, const char *text, size_t length); // unprintable bytes: '?'
void ep_text_add_number(char *message, long long number);

// Set the message and return EP_ERR_FORMAT.
ep_status ep_text_refuse(char *message, const char *text);

#endif
