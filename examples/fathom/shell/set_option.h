/* --set NAME=VALUE: any setting of the library's table (fathom_config_set). */
#ifndef FATHOM_SHELL_SET_OPTION_H
#define FATHOM_SHELL_SET_OPTION_H

#include <stdbool.h>

#include "fathom.h"

/* Sets NAME=VALUE in *config. False after an error message. A text's value stays in `text`. */
bool set_option_apply(const char *option, const char *text, fathom_config *config);

/* Whether NAME=VALUE is for that name. */
bool set_option_names(const char *text, const char *name);

#endif
