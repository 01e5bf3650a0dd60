/* .oni recordings as sources. */
#ifndef FATHOM_OPENNI2_PLAYBACK_H
#define FATHOM_OPENNI2_PLAYBACK_H

#include "source.h"

/* As source_driver.open, for the path of a recording. */
int openni2_play(fathom_source **source, const char *path, const fathom_source_options *options);

#endif
