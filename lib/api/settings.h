/* The default settings and their check. */
#ifndef FATHOM_CONFIG_H
#define FATHOM_CONFIG_H

#include "fathom.h"

#define CONFIG_MIN_BLOCKS 64 /* of a pool */
#define CONFIG_MAX_BLOCKS 16777216

/* All settings at their defaults. */
fathom_config config_default(void);

/* The defaults with the preset's changes; a preset that doesn't exist changes nothing. */
fathom_config config_preset(int32_t preset);

/* FATHOM_OK, or FATHOM_ERROR_CONFIG after a log message that names the setting, its value, range and unit. */
int config_check(const fathom_config *config);

#endif
