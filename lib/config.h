/* The default settings and their check. */
#ifndef FATHOM_CONFIG_H
#define FATHOM_CONFIG_H

#include "fathom.h"

/* FATHOM_OK, or FATHOM_ERROR_CONFIG after a log message that names the setting. */
int config_check(const fathom_config *config);

#endif
