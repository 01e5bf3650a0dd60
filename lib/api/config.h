/* The caller's settings, whatever their struct's size. */
#ifndef FATHOM_API_CONFIG_H
#define FATHOM_API_CONFIG_H

#include "base/error_text.h"

/* Takes the caller's settings in, with defaults where the caller's struct ends, and routes their log through it.
 * FATHOM_OK, _ARGUMENT or _CONFIG. */
int config_take(const fathom_config *config, fathom_config *whole, error_text *r);

#endif
