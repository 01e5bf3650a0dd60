/* Spoils frames of a recording on purpose: a covered lens, a bare wall, a card in front of the camera. Frames
 * are counted as the recording has them, whatever the stride. */
#ifndef FATHOM_CLI_DISTURB_H
#define FATHOM_CLI_DISTURB_H

#include <stdbool.h>

#include "fathom_drivers.h"
#include "fathom/shell/option_values.h"

/* A wall, in the frame of the reference poses: all points x with normal . x = offset. */
struct disturb_wall {
    double normal[3], offset;
};

struct disturb {
    const fathom_recording *recording;
    const struct frame_ranges *outages, *walls, *cards;
    struct disturb_wall wall[MOST_RANGES];
    uint16_t card[MOST_RANGES]; /* depth in units */
};

/* Looks at the frames that say where walls and cards stand; pixels is room for one frame. Returns a CLI_
 * status, and says what was wrong, except for a frame that can't be read: that is in the recording's log. */
int disturb_prepare(struct disturb *disturb, const fathom_recording *recording,
                    const struct frame_ranges *outages, const struct frame_ranges *walls,
                    const struct frame_ranges *cards, uint16_t *pixels);

/* The frame's file need not be read: it arrives blank, as a card or as a wall. */
bool disturb_replaces(const struct disturb *disturb, int frame);

/* Fills in that frame. False, and says so, when there is no reference pose for a wall. */
bool disturb_render(const struct disturb *disturb, int frame, uint16_t *pixels);

#endif
