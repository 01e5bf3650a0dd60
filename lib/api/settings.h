/* The default settings and their check. */
#ifndef FATHOM_CONFIG_H
#define FATHOM_CONFIG_H

#include "fathom.h"

#define CONFIG_BLOCKS_LEAST 64 /* of a pool */
#define CONFIG_BLOCKS_MOST 16777216

/* FATHOM_OK, or FATHOM_ERROR_CONFIG after a log message that names the setting. */
int config_check(const fathom_config *config);

#endif
